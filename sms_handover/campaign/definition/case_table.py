"""Table of cases: a CSV file, its header dotted paths, a row per case, checked when it is read."""

import csv
import re
from collections.abc import Iterator, Mapping
from io import StringIO
from math import isfinite
from pathlib import Path
from reprlib import repr as shortened
from types import MappingProxyType

from sms_handover.campaign.definition.distributions import Value
from sms_handover.campaign.definition.values import require_allowed, require_settable
from sms_handover.configuration.yaml_reader import load_value, read_text
from sms_handover.errors import ConfigurationError

_LARGEST = 2**26  # [byte] of a file
_PLAIN = re.compile(r"-?[0-9]+\.[0-9]+([eE][-+]?[0-9]+)?")  # as most cells are; YAML is much slower
_BYTE_ORDER_MARK = "\ufeff"  # with which spreadsheets begin a file


def read_table(path: Path) -> tuple[Mapping[str, Value], ...]:
    """Return the rows of a file; raises ConfigurationError with line and column of what is wrong."""
    try:
        text = read_text(path, _LARGEST).removeprefix(_BYTE_ORDER_MARK)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigurationError(f"cannot read {path}: {error}") from error
    rows = _rows(text, path)
    place, header = next(rows, (f"{path}:1", []))
    header = [column.strip() for column in header]
    if not header or not all(header):
        raise ConfigurationError(f"{place}: must be a header of dotted paths, one for each column")
    for column in header:
        if header.count(column) > 1:
            raise ConfigurationError(f"{place}: column {column} is given twice")
        require_settable(column, f"{place}: column {column}")
    found = [_case(header, cells, place) for place, cells in rows]
    if not found:
        raise ConfigurationError(f"{place}: has no row of a case below the header")
    return tuple(found)


def _rows(text: str, path: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield each row that is not blank with file and line of its first cell."""
    reader = csv.reader(StringIO(text, newline=None), skipinitialspace=True)  # lines may end as they like
    line = 1
    try:
        for cells in reader:
            if cells:
                yield f"{path}:{line}", cells
            line = reader.line_num + 1
    except csv.Error as error:
        raise ConfigurationError(f"{path}:{line}: {error}") from error


def _case(header: list[str], cells: list[str], place: str) -> Mapping[str, Value]:
    """Return the values of a row by their columns; raises ConfigurationError."""
    if len(cells) != len(header):
        raise ConfigurationError(f"{place}: has {len(cells)} cells, must have {len(header)}")
    return MappingProxyType(
        {column: _value(column, cell, place) for column, cell in zip(header, cells, strict=True)}
    )


def _value(column: str, cell: str, place: str) -> Value:
    """Return the value of a cell; raises ConfigurationError on one that no case can have."""
    what = f"{place}: {column}"
    plain = cell.strip()
    if not plain:
        raise ConfigurationError(f"{what} is empty, must be a value")
    value = float(plain) if _PLAIN.fullmatch(plain) else load_value(cell, f"{what}:={cell}")
    if not isinstance(value, bool | int | float | str):
        raise ConfigurationError(f"{what} is {shortened(cell)}, must be a number, a text, true or false")
    if isinstance(value, float) and not isfinite(value):
        raise ConfigurationError(f"{what} is {plain}, must be finite")
    require_allowed(column, value, what)
    return value
