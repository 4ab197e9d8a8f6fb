"""Content of conditions: their YAML with the files of wrenches over time in their places."""

import csv
from copy import copy
from pathlib import Path
from typing import Any

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.yaml_reader import Mapping, read_file, read_yaml
from sms_handover.errors import ConfigurationError, UnknownNameError

_SUFFIX = ".yaml"
_WRENCHES, _HISTORY, _FILE, _ROWS = "wrenches", "history", "file", "rows"


def condition_names() -> tuple[str, ...]:
    """Return the names of the shipped conditions."""
    return tuple(sorted(path.stem for path in config_file("conditions").glob(f"*{_SUFFIX}")))


def read_conditions_content(path: Path) -> Mapping:
    """Return the content of shipped conditions, or those in a file.

    Raises UnknownNameError if there is neither, and ConfigurationError on a file that cannot be read.
    """
    if path.name in condition_names():
        path = config_file(f"conditions/{path.name}{_SUFFIX}")
    elif path.suffix != _SUFFIX:
        raise UnknownNameError("conditions", path.name, condition_names())
    return with_histories(read_yaml(path), path.parent)


def with_histories(content: Mapping, folder: Path) -> Mapping:
    """Return the content of conditions with the files that wrenches name read, relative to ``folder``.

    Anything that is not as conditions have it is left to their reader.
    """
    wrenches = content.get(_WRENCHES)
    if not isinstance(wrenches, Mapping):
        return content
    result, changed = copy(content), copy(wrenches)
    for name, wrench in wrenches.items():
        history = wrench.get(_HISTORY) if isinstance(wrench, Mapping) else None
        if not isinstance(history, Mapping):
            continue
        file = history.get(_FILE)
        if isinstance(file, str):
            inner = copy(history)
            del inner[_FILE]
            inner[_ROWS] = _rows(folder / file)
            changed[name] = copy(wrench)
            changed[name][_HISTORY] = inner
    result[_WRENCHES] = changed
    return result


def _rows(path: Path) -> list[Any]:
    """Return the rows of numbers in a CSV file; raises ConfigurationError."""
    rows = [row for row in csv.reader(read_file(path).splitlines()) if row]
    try:
        return [[float(cell) for cell in row] for row in rows]
    except ValueError as error:
        raise ConfigurationError(f"{path}: must have numbers alone: {error}") from None
