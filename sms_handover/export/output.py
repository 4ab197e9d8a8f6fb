"""Output folder of an export: its tables and the description of their columns."""

import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from sms_handover.bag.info import BagInfo
from sms_handover.export.table import Column, Format, TableFile, kind_text

TABLES_FILE = "tables.json"  # names, kinds and units of all columns


class Tables:
    """The tables of an export.

    ``rows`` are counts by table; of a topic that was not exported, or not wholly, ``skipped`` is the reason
    and ``left_out`` the number of messages.
    """

    def __init__(self, folder: Path, file_format: Format) -> None:
        self.rows: dict[str, int] = {}
        self.skipped: dict[str, str] = {}
        self.left_out: Counter[str] = Counter()
        self.missing: Sequence[str] = ()  # of the bag itself, in words
        self.folder, self._format = folder, file_format
        self._columns: dict[str, Sequence[Column]] = {}
        self._topics: dict[str, str] = {}

    def open(self, name: str, columns: Sequence[Column], topic: str = "") -> tuple[str, TableFile]:
        """Open a table; return the unique stem of its file, and the file."""
        stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", name.strip("/").replace("/", ".")) or "root"
        taken = {known.lower() for known in self._columns}
        while stem.lower() in taken:
            stem += "_"
        self._columns[stem], self._topics[stem] = columns, topic
        self.rows[stem] = 0
        return stem, self._format.open(stem, columns)

    def describe(self, info: BagInfo) -> None:
        """Write the description of every column."""
        tables = {
            f"{stem}{self._format.suffix}": {
                **({"topic": self._topics[stem]} if self._topics[stem] else {}),
                "rows": self.rows[stem],
                "columns": [
                    {"name": column.name, "kind": kind_text(column.kind), "unit": column.unit}
                    for column in columns
                ],
            }
            for stem, columns in self._columns.items()
        }
        content = {"bag": info.path.name, "tables": tables, "skipped": self.skipped}
        text = json.dumps(content, indent=1, ensure_ascii=False)
        (self.folder / TABLES_FILE).write_text(text + "\n", encoding="utf-8", errors="backslashreplace")
