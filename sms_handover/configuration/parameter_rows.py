"""Rows of a table of parameters for readers, everything as text."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sms_handover.configuration.parameters import specs_of

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
    return tuple(
        ParameterRow(
            name=name,
            type=_TYPES[spec.kind],
            default=_value(defaults[name]),
            unit=spec.unit.replace("-", ""),
            allowed=spec.allowed,
            description=spec.description,
        )
        for name, spec in specs_of(cls).items()
    )


def _value(value: object) -> str:
    """Return a default as it is written on a command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(str, value)) + "]"
    return "''" if value == "" else str(value)
