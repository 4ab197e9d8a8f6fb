"""Rows of a table of parameters for readers, everything as text."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from sms_handover.configuration.parameters import ParameterSpec, spec_of

_TYPES = {
    bool: "bool",
    int: "integer",
    float: "double",
    str: "string",
    tuple[float, ...]: "double_array",
    tuple[str, ...]: "string_array",
}  # as `ros2 param describe` names them


@dataclass(frozen=True)
class ParameterRow:
    """One parameter for readers: everything as text, '' where there is none."""

    name: str
    type: str
    default: str
    unit: str
    allowed: str
    description: str


def rows_of(cls: type[Any], defaults: Mapping[str, object]) -> tuple[ParameterRow, ...]:
    """Return the parameters of a dataclass, with their defaults by name."""
    hints = get_type_hints(cls)
    return tuple(
        ParameterRow(
            name=item.name,
            type=_TYPES[hints[item.name]],
            default=_value(defaults[item.name]),
            unit=spec_of(item).unit.replace("-", ""),
            allowed=_allowed(spec_of(item)),
            description=spec_of(item).description,
        )
        for item in fields(cls)
    )


def _value(value: object) -> str:
    """Return a default as it is written on a command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(str, value)) + "]"
    return "''" if value == "" else str(value)


def _allowed(spec: ParameterSpec) -> str:
    """Return the values allowed in words; '' if every value of the type is."""
    if spec.choices:
        return " | ".join(spec.choices)
    bounds = []
    if spec.minimum is not None:
        bounds.append(f"at least {spec.minimum:.15g}")
    if spec.maximum is not None:
        bounds.append(f"at most {spec.maximum:.15g}")
    return ", ".join(bounds)
