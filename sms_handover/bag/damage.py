"""What is wrong at a place of a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType


@dataclass(frozen=True)
class Damage:
    """Bytes ``begin`` to ``end`` of a file that cannot be used, and why.

    ``start_ns`` and ``end_ns`` are the log times of the messages that were there, None where nobody
    tells; ``messages`` counts them by topic, as far as an index tells. Damage ``of_index`` costs no
    message: the bytes only tell again what the rest of the file holds.
    """

    file: Path
    begin: int
    end: int
    reason: str
    start_ns: int | None = None
    end_ns: int | None = None
    messages: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    of_index: bool = False

    @property
    def size(self) -> int:
        """Return the number of bytes."""
        return self.end - self.begin

    def __str__(self) -> str:
        """Return the damage in words, with its place."""
        return f"{self.file.name}: bytes {self.begin} to {self.end}: {self.reason}"
