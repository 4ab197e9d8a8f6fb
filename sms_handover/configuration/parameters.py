"""Parameters as frozen dataclasses, each field with its unit, range and meaning.

A node declares such a dataclass as ROS parameters, the in-process simulation builds it from the
same YAML files; both use :func:`build`, so both reject the same values with the same words.
The numbers are in ``config/``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from math import inf
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, TypeVar, get_type_hints

from sms_handover.configuration.checks import check_number
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


@dataclass(frozen=True)
class ParameterSpec:
    """Meaning, unit and allowed values of a parameter."""

    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()


def parameter(
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Sequence[str] = (),
    default: Any = MISSING,
) -> Any:
    """Return a dataclass field with a :class:`ParameterSpec`; bounds are inclusive.

    Parameters of this package have their defaults in ``config/``, others may give a ``default``.
    """
    spec = ParameterSpec(description, unit, minimum, maximum, tuple(choices))
    return field(default=default, metadata={_SPEC: spec})


def spec_of(item: "Field[Any]") -> ParameterSpec:
    """Return the specification of a field made by :func:`parameter`."""
    spec: ParameterSpec = item.metadata[_SPEC]
    return spec


def build(
    cls: type[T], values: Mapping[str, object], where: str, places: Mapping[str, str] | None = None
) -> T:
    """Return ``cls`` filled from ``values`` after checking names, types, ranges and choices.

    ``where`` names the origin (a file, a node) in error messages, ``places`` that of single values
    where it is known. A list gives a tuple, an integer is accepted as a float. Raises
    ConfigurationError on a missing or bad value and UnknownNameError on a name that ``cls`` does not have.
    """
    hints = get_type_hints(cls)
    known = {item.name: item for item in fields(cls)}  # type: ignore[arg-type]
    origin = {name: where for name in (*known, *values)} | dict(places or {})
    for name in values:
        if name not in known:
            raise UnknownNameError("parameter", name, known, origin[name])
    values = {**defaults_of(cls), **values}
    missing = [name for name in known if name not in values]
    if missing:
        raise ConfigurationError(f"{where}: parameter {missing[0]!r} is missing")
    checked = {
        name: _check(values[name], hints[name], spec_of(item), f"{origin[name]}: parameter {name!r}")
        for name, item in known.items()
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


def _check(value: object, hint: Any, spec: ParameterSpec, what: str) -> object:
    """Return ``value`` as the type ``hint`` asks for, or raise ConfigurationError."""
    if hint == tuple[float, ...] or hint == tuple[str, ...]:
        if not isinstance(value, list | tuple):
            raise ConfigurationError(f"{what} is {shortened(value)}, must be a list")
        inner = float if hint == tuple[float, ...] else str
        return tuple(_check(item, inner, spec, what) for item in value)
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            allowed = "text" if hint is str else "true or false"
            raise ConfigurationError(f"{what} is {shortened(value)}, must be {allowed}")
        if spec.choices and value not in spec.choices:
            raise UnknownNameError("value", str(value), spec.choices, what)
        return value
    minimum = -inf if spec.minimum is None else spec.minimum
    maximum = inf if spec.maximum is None else spec.maximum
    return check_number(value, what, spec.unit, minimum=minimum, maximum=maximum, whole=hint is int)
