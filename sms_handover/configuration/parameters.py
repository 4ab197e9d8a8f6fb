"""Parameters as frozen dataclasses, each field with its unit, range and meaning.

A node declares such a dataclass as ROS parameters, the in-process simulation builds it from the
same YAML files; both use :func:`build`, so both reject the same values with the same words.
The numbers are in ``config/``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from sms_handover.configuration.field_specification import ValueSpec
from sms_handover.configuration.sections import Section
from sms_handover.errors import ConfigurationError, UnknownNameError

T = TypeVar("T")

_SPEC = "sms_handover.spec"
EVERY_NODE = "/**"  # section of ROS parameter files that holds for every node


class ParameterValues(dict[str, object]):
    """Parameters by name, with the file and line that each was read from."""

    def __init__(self) -> None:
        super().__init__()
        self.places: dict[str, str] = {}


def parameter(
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Sequence[str] = (),
    default: Any = MISSING,
) -> Any:
    """Return a dataclass field with a ``ValueSpec``; bounds are inclusive.

    Parameters of this package have their defaults in ``config/``, others may give a ``default``.
    """
    spec = ValueSpec(description, unit, minimum, maximum, tuple(choices))
    return field(default=default, metadata={_SPEC: spec})


def specs_of(cls: type[object]) -> dict[str, ValueSpec]:
    """Return the specifications of the fields of a parameter group, which :func:`parameter` made."""
    hints, all_fields = get_type_hints(cls), fields(cls)  # type: ignore[arg-type]
    return {item.name: replace(item.metadata[_SPEC], kind=hints[item.name]) for item in all_fields}


def build(
    cls: type[T], values: Mapping[str, object], where: str, places: Mapping[str, str] | None = None
) -> T:
    """Return ``cls`` filled from ``values`` after checking names, types, ranges and choices.

    ``where`` names the origin (a file, a node) in error messages, ``places`` that of single values
    where it is known. A list gives a tuple, an integer is accepted as a float. Raises
    ConfigurationError on a missing or bad value and UnknownNameError on a name that ``cls`` does not have.
    """
    known = specs_of(cls)
    origin = {name: where for name in (*known, *values)} | dict(places or {})
    for name in values:
        if name not in known:
            raise UnknownNameError("parameter", name, known, origin[name])
    values = {**defaults_of(cls), **values}
    missing = [name for name in known if name not in values]
    if missing:
        raise ConfigurationError(f"{where}: parameter {missing[0]!r} is missing")
    checked = {
        name: spec.check(values[name], f"{origin[name]}: parameter {name!r}") for name, spec in known.items()
    }
    return cls(**checked)


def defaults_of(cls: type[object]) -> dict[str, object]:
    """Return the defaults that the fields of a parameter group have themselves."""
    all_fields = fields(cls)  # type: ignore[arg-type]
    return {item.name: item.default for item in all_fields if item.default is not MISSING}


def read_parameter_files(paths: Sequence[Path], section: str) -> ParameterValues:
    """Return the parameters in one section of files in ROS 2 form; later files win.

    A section is the name of a node, or :data:`EVERY_NODE` for parameters that all nodes share.
    """
    merged = ParameterValues()
    for path in paths:
        document = Section.read(path)
        if section in document:
            values = document.section(section).section("ros__parameters")
            merged.update((name, values.value(name)) for name in values.keys)
            merged.places.update((name, values.where(name)) for name in values.keys)
    return merged
