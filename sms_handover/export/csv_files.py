"""CSV files (RFC 4180); numbers have enough digits to read back bit for bit."""

import base64
import csv
import json
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from sms_handover.export.table import Column, Format, Kind, ListOf, StructOf, TableFile

_PLAIN = {"string", "float32", "float64"}  # written as is; csv writes the shortest exact float


class CsvFormat(Format):
    """CSV files in a folder."""

    suffix = ".csv"

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Create the file of a table, with the column names in its first line."""
        return _CsvFile(self._folder / f"{stem}{self.suffix}", columns)


class _CsvFile(TableFile):
    """One CSV file."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        self._special = [
            (place, column.kind)
            for place, column in enumerate(columns)
            if not (isinstance(column.kind, str) and (column.kind in _PLAIN or "int" in column.kind))
        ]
        self._stream = path.open("x", encoding="utf-8", errors="backslashreplace", newline="")
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
    """Return a list or struct as JSON, bytes as base64, a bool as true or false."""
    if isinstance(kind, ListOf | StructOf):
        try:
            return json.dumps(value, ensure_ascii=False, allow_nan=False, default=_base64)
        except ValueError:  # JSON has no such numbers
            return json.dumps(_named(value), ensure_ascii=False, default=_base64)
    if kind == "binary":
        return _base64(value)
    return "true" if value else "false"


def _base64(value: bytes) -> str:
    """Return bytes as base64."""
    return base64.b64encode(value).decode("ascii")


def _named(value: Any) -> Any:
    """Return a value with ``"NaN"``, ``"Infinity"`` and ``"-Infinity"`` for these, as in JSON of protobuf."""
    if isinstance(value, list):
        return [_named(item) for item in value]
    if isinstance(value, dict):
        return {name: _named(item) for name, item in value.items()}
    return json.dumps(value) if isinstance(value, float) and not isfinite(value) else value
