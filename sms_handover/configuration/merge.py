"""Merge of YAML documents: one says what differs from another."""

from collections.abc import Iterator
from copy import copy
from pathlib import Path
from reprlib import repr as shortened
from typing import Any

from sms_handover.configuration.yaml_reader import Mapping
from sms_handover.errors import ConfigurationError, UnknownNameError

_NAME = "name"


def merged(base: Mapping, changes: Mapping, file: Path, *, complete: bool = True) -> Mapping:
    """Return ``base`` with the changes of a mapping that stands in ``file``.

    Mappings merge by key and lists of named things by name, also where the changes are a mapping from name
    to change; ``null`` removes; anything else replaces what was there. Unless the base is ``complete``, as
    where it is itself a change, ``null`` stays. Neither of the two is changed. Raises ConfigurationError on a
    change of a named thing that is no mapping, and UnknownNameError where there is nothing to remove.
    """
    result, file = copy(base), changes.file or file
    result.origins = dict(base.origins)
    for key, change in changes.items():
        old = base.get(key)
        place = changes.origins.get(key) or f"{file}:{changes.lines.get(key, changes.line)}"
        if change is None and complete:
            _remove(result, key, "key", place)
        elif isinstance(old, Mapping) and isinstance(change, Mapping):
            result[key] = merged(old, change, file, complete=complete)
        elif old and _is_named(old) and (isinstance(change, Mapping) or _is_named(change)):
            result[key] = _merged_by_name(old, change, file)
        else:
            result[key] = standing_in(change, file)
            result.origins[key] = place
    return result


def standing_in(value: Any, file: Path) -> Any:
    """Return a value whose mappings know the file that they stand in."""
    if isinstance(value, list):
        return [standing_in(item, file) for item in value]
    if not isinstance(value, Mapping) or value.file:
        return value
    owned = copy(value)
    owned.file = file
    return owned


def _merged_by_name(items: list[Mapping], changes: Any, file: Path) -> list[Mapping]:
    """Return named things with changes; one that is new comes last."""
    result = {item[_NAME]: item for item in items}
    for name, change in _by_name(changes, file):
        if change is None:
            _remove(result, name, "name", f"{file}:{changes.lines.get(name, changes.line)}")
        elif name in result:
            result[name] = merged(result[name], change, file)
        else:
            result[name] = copy(standing_in(change, file))
            result[name].setdefault(_NAME, name)
    return list(result.values())


def _remove(result: dict[Any, Any], key: Any, what: str, place: str) -> None:
    """Remove what ``null`` says is to go; raises UnknownNameError if it is not there."""
    if key not in result:
        raise UnknownNameError(what, str(key), map(str, result), f"{place}: null")
    del result[key]


def _by_name(changes: Any, file: Path) -> Iterator[tuple[Any, Mapping | None]]:
    """Yield name and change of named things."""
    if isinstance(changes, list):
        yield from ((change[_NAME], change) for change in changes)
        return
    for name, change in changes.items():
        if change is not None and not isinstance(change, Mapping):
            place = f"{file}:{changes.lines.get(name, changes.line)}"
            raise ConfigurationError(f"{place}: {name} is {shortened(change)}, must be a mapping or null")
        yield name, change


def _is_named(value: Any) -> bool:
    """Whether a value is a list of named things."""
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(item, Mapping) and isinstance(item.get(_NAME), str) for item in value)
    )
