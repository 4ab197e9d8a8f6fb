"""Tables as CSV (RFC 4180), every number with as many digits as it takes to read the same bits again."""

import base64
import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sms_handover.export.table import Column, Format, Kind, ListOf, StructOf, TableFile

_PLAIN = {"string", "float32", "float64"}  # written as they are; csv writes the shortest exact float


class CsvFormat(Format):
    """CSV files in a folder."""

    suffix = ".csv"

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Create the file of a table, with the names of the columns in its first line."""
        return _CsvFile(self._folder / f"{stem}{self.suffix}", columns)


class _CsvFile(TableFile):
    """One CSV file."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        self._special = [
            (place, column.kind)
            for place, column in enumerate(columns)
            if not (isinstance(column.kind, str) and (column.kind in _PLAIN or "int" in column.kind))
        ]
        self._stream = path.open("x", encoding="utf-8", newline="")
        self._writer = csv.writer(self._stream)
        self._writer.writerow([column.name for column in columns])

    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Append rows."""
        if not self._special:
            self._writer.writerows(rows)
            return
        for row in rows:
            cells = list(row)
            for place, kind in self._special:
                cells[place] = _cell(cells[place], kind)
            self._writer.writerow(cells)

    def close(self) -> None:
        """Complete the file."""
        self._stream.close()


def _cell(value: Any, kind: Kind) -> str:
    """Return a value that is no number or text as a cell: lists and structs as JSON, bytes as base64."""
    if isinstance(kind, ListOf | StructOf):
        return json.dumps(_plain(value), ensure_ascii=False)
    if kind == "binary":
        return base64.b64encode(value).decode("ascii")
    return "true" if value else "false"


def _plain(value: Any) -> Any:
    """Return a value with bytes as base64 in it."""
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value
