"""Parameters as frozen dataclasses, each field with its unit, range and meaning.

A node declares such a dataclass as ROS parameters, the in-process simulation builds it from the
same YAML files; both go through :func:`build`, so both refuse the same values with the same words.
The numbers live in ``config/``, never here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from math import inf, isfinite
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import yaml

from sms_handover.configuration import yaml_reader as yaml_files
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
    """What is known of a parameter besides its type: meaning, unit and the values allowed."""

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
    """Return a dataclass field that carries a :class:`ParameterSpec`; bounds are inclusive.

    The parameters of this package have their defaults in ``config/``; others may give a ``default`` here.
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

    ``where`` names the origin (a file, a node) in error messages, ``places`` those of single values
    where they are known more closely. A list gives a tuple, an
    integer is taken where a float is asked for. Raises ConfigurationError on a missing or bad
    value and UnknownNameError on a name that ``cls`` does not have.
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
        document = read_yaml(path)
        content = document.get(section)
        if content is None:
            continue
        values = content.get("ros__parameters") if isinstance(content, dict) else None
        if not isinstance(values, dict):
            place = f"{path}{yaml_files.line_in(document, section)}"
            raise ConfigurationError(f"{place}: section {section!r} needs a mapping 'ros__parameters'")
        merged.update(values)
        merged.places.update((name, f"{path}{yaml_files.line_in(values, name)}") for name in values)
    return merged


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file, loaded safely; raises ConfigurationError naming the line."""
    try:
        document = yaml_files.load(yaml_files.read_text(path))
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigurationError(f"{path} is not valid YAML: {yaml_files.reason(error)}") from error
    if not isinstance(document, dict):
        raise ConfigurationError(f"{path}: expected a mapping at the top level")
    return document


def _check(value: object, hint: Any, spec: ParameterSpec, where: str) -> object:
    """Return ``value`` as the type ``hint`` asks for, or raise ConfigurationError."""
    if hint == tuple[float, ...] or hint == tuple[str, ...]:
        if not isinstance(value, list | tuple):
            raise ConfigurationError(f"{where} is {value!r}, expected a list")
        inner = float if hint == tuple[float, ...] else str
        return tuple(_check(item, inner, spec, where) for item in value)
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            raise ConfigurationError(f"{where} is {value!r}, expected {hint.__name__}")
        if spec.choices and value not in spec.choices:
            raise UnknownNameError("value", str(value), spec.choices, where)
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(f"{where} is {value!r}, expected a number" + _unit(spec))
    if hint is int and not isinstance(value, int):
        raise ConfigurationError(f"{where} is {value!r}, expected a whole number" + _unit(spec))
    if not isfinite(as_float(value)):
        raise ConfigurationError(f"{where} is {as_float(value)}, expected a finite number" + _unit(spec))
    if spec.minimum is not None and value < spec.minimum:
        raise ConfigurationError(f"{where} is {value}{_unit(spec)}, allowed is at least {spec.minimum}")
    if spec.maximum is not None and value > spec.maximum:
        raise ConfigurationError(f"{where} is {value}{_unit(spec)}, allowed is at most {spec.maximum}")
    return float(value) if hint is float else value


def as_float(value: float) -> float:
    """Return a number as a float; a whole number beyond every float is infinite."""
    try:
        return float(value)
    except OverflowError:
        return inf


def _unit(spec: ParameterSpec) -> str:
    """Return the unit with a space before it, or nothing."""
    return f" {spec.unit}" if spec.unit else ""
