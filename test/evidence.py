"""One measured number and the bound it has to keep, as the verification report shows it."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from math import isnan
from pathlib import Path

Record = Callable[..., None]
Table = Callable[[str], None]


@dataclass(frozen=True)
class Evidence:
    """What was measured: a figure, its bound (the figure must not exceed it) and who says so.

    ``against`` names the independent answer: another engine, a closed form, a published value.
    """

    section: str
    claim: str
    value: float
    bound: float
    unit: str
    against: str
    test: str

    @property
    def holds(self) -> bool:
        """Whether the bound is kept; NaN keeps none."""
        return not isnan(self.value) and self.value <= self.bound


@dataclass
class Ledger:
    """All evidence of a session, and whole tables that belong to a section."""

    entries: list[Evidence] = field(default_factory=list)
    tables: dict[str, str] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write everything as JSON."""
        content = {"evidence": [asdict(entry) for entry in self.entries], "tables": self.tables}
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
