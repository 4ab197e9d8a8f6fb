"""MATLAB files (version 5), a variable per column, with the units of the columns beside them; needs scipy."""

import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.export.table import Column, Format, Kind, ListOf, StructOf, TableFile

_LONGEST = 63  # characters of a name that MATLAB reads


class MatlabFormat(Format):
    """MAT files in a folder; a table is held in memory until it is written."""

    suffix = ".mat"

    def __init__(self, folder: Path) -> None:
        """Write to ``folder``; raises ConfigurationError if scipy is not installed."""
        try:
            self._save: Any = import_module("scipy.io").savemat
        except ImportError as error:
            raise ConfigurationError(
                "MATLAB files need scipy, which is not installed: pip install 'sms_handover[matlab]', "
                "or export with --format csv"
            ) from error
        self._folder = folder

    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Open a table; its file is created when it is complete."""
        return _MatlabFile(self._save, self._folder / f"{stem}{self.suffix}", columns)


class _MatlabFile(TableFile):
    """One MAT file: ``columns``, ``units`` and the variables, named as the columns as far as MATLAB can."""

    def __init__(self, save: Any, path: Path, columns: Sequence[Column]) -> None:
        self._save, self._path, self._columns = save, path, columns
        self._values: list[list[Any]] = [[] for _ in columns]

    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Append rows."""
        for row in rows:
            for value, values in zip(row, self._values, strict=True):
                values.append(value)

    def close(self) -> None:
        """Write the file."""
        names = _variables([column.name for column in self._columns])
        content = {
            name: _array(values, column.kind)
            for name, column, values in zip(names, self._columns, self._values, strict=True)
        }
        content["columns"] = _cells([column.name for column in self._columns])
        content["units"] = _cells([column.unit for column in self._columns])
        with self._path.open("xb") as stream:
            self._save(stream, content, long_field_names=True, oned_as="column")


def _variables(names: Sequence[str]) -> list[str]:
    """Return a name for each column that MATLAB takes, all different."""
    found: list[str] = []
    for name in names:
        base = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")
        base = (base if base[:1].isalpha() else f"x{base}")[:_LONGEST]
        new, number = base, 1
        while new in (*found, "columns", "units"):
            number += 1
            new = f"{base[: _LONGEST - 4]}_{number}"
        found.append(new)
    return found


def _array(values: Sequence[Any], kind: Kind) -> Any:
    """Return the values of a column as what becomes a numeric array or a cell array."""
    if isinstance(kind, ListOf | StructOf) or kind in ("string", "binary"):
        return _cells([_cell(value, kind) for value in values])
    return np.array(values, dtype=kind)


def _cell(value: Any, kind: Kind) -> Any:
    """Return one cell: a list as a column, a struct as a struct, bytes as uint8."""
    if isinstance(kind, StructOf):
        return {name: _cell(value[name], item) for name, item in kind.fields}
    if isinstance(kind, ListOf):
        return _array(value, kind.item)
    return np.frombuffer(value, np.uint8) if kind == "binary" else value


def _cells(values: Sequence[Any]) -> Any:
    """Return values as an object array, which becomes a cell array."""
    cells = np.empty(len(values), dtype=object)
    cells[:] = values
    return cells
