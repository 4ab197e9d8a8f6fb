"""Checks on single values of a robot description; an error names the value, its unit and what is allowed."""

from collections.abc import Sequence
from math import isfinite, sqrt

import numpy as np

from sms_handover.configuration.parameters import as_float
from sms_handover.errors import RobotDescriptionError
from sms_handover.types import Array

_AXIS_TOLERANCE = 1e-9  # [-] on the length of a joint axis
_TRIANGLE_TOLERANCE = 1e-9  # [-] relative; a flat body fulfils the inequality with equality


def number(value: object, what: str, unit: str = "") -> float:
    """Return ``value`` as a finite float; raises RobotDescriptionError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RobotDescriptionError(f"{what} is {value!r}, expected a number{_in(unit)}")
    if not isfinite(as_float(value)):
        raise RobotDescriptionError(f"{what} is {as_float(value)}{_unit(unit)}, expected a finite number")
    return float(value)


def positive(value: object, what: str, unit: str) -> float:
    """Return ``value`` as a float above zero; raises RobotDescriptionError."""
    checked = number(value, what, unit)
    if checked <= 0.0:
        raise RobotDescriptionError(f"{what} is {checked}{_unit(unit)}, allowed is more than 0")
    return checked


def not_negative(value: object, what: str, unit: str) -> float:
    """Return ``value`` as a float of zero or above; raises RobotDescriptionError."""
    checked = number(value, what, unit)
    if checked < 0.0:
        raise RobotDescriptionError(f"{what} is {checked}{_unit(unit)}, allowed is 0 or more")
    return checked


def vector(values: object, length: int, what: str, unit: str = "") -> tuple[float, ...]:
    """Return ``values`` as ``length`` finite floats; raises RobotDescriptionError."""
    if not isinstance(values, list | tuple):
        raise RobotDescriptionError(f"{what} is {values!r}, expected a list of {length} numbers{_in(unit)}")
    if len(values) != length:
        raise RobotDescriptionError(f"{what} has {len(values)} numbers, expected {length}{_in(unit)}")
    return tuple(number(item, f"{what}[{index}]", unit) for index, item in enumerate(values))


def positive_vector(values: object, length: int, what: str, unit: str) -> tuple[float, ...]:
    """Return ``values`` as ``length`` floats above zero; raises RobotDescriptionError."""
    checked = vector(values, length, what, unit)
    return tuple(positive(item, f"{what}[{index}]", unit) for index, item in enumerate(checked))


def check_unit_axis(axis: Sequence[float], what: str) -> None:
    """Raise RobotDescriptionError unless ``axis`` (3,) has length 1."""
    length = sqrt(sum(component**2 for component in axis))
    if abs(length - 1.0) > _AXIS_TOLERANCE:
        raise RobotDescriptionError(f"{what} {list(axis)} has length {length:.9g}, allowed is 1")


def check_position_limits(lower: float, upper: float, what: str) -> None:
    """Raise RobotDescriptionError unless both (rad) are finite and lower < upper."""
    number(lower, f"{what} lower", "rad")
    number(upper, f"{what} upper", "rad")
    if lower >= upper:
        raise RobotDescriptionError(f"{what} is [{lower}, {upper}] rad, allowed is lower < upper")


def check_moments(moments: Sequence[float], what: str) -> None:
    """Raise RobotDescriptionError unless ``moments`` (kg m^2) are those of a real body.

    ``moments`` are the entries ixx ixy ixz iyy iyz izz of the inertia matrix about the centre of
    mass. The principal moments must be positive and none may exceed the sum of the other two, as
    their integrals over mass demand.
    """
    smallest, middle, largest = (float(value) for value in np.linalg.eigvalsh(moment_matrix(moments)))
    principal = f"principal moments {smallest:.6g}, {middle:.6g}, {largest:.6g} kg m^2"
    if smallest <= 0.0:
        raise RobotDescriptionError(f"{what} has {principal}, allowed is all more than 0")
    if largest > (smallest + middle) * (1.0 + _TRIANGLE_TOLERANCE):
        raise RobotDescriptionError(f"{what} has {principal}, allowed is none above the sum of the other two")


def moment_matrix(moments: Sequence[float]) -> Array:
    """Return the symmetric (3, 3) matrix of ixx ixy ixz iyy iyz izz."""
    ixx, ixy, ixz, iyy, iyz, izz = moments
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=np.float64)


def _unit(unit: str) -> str:
    """Return the unit with a space before it, or nothing."""
    return f" {unit}" if unit else ""


def _in(unit: str) -> str:
    """Return the unit as part of a sentence, or nothing."""
    return f" in {unit}" if unit else ""
