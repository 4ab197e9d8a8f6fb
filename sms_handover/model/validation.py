"""Validation of a robot description: what makes numbers an axis, limits and the inertia of a real body."""

from collections.abc import Sequence
from functools import partial
from math import sqrt

import numpy as np

from sms_handover.configuration.checks import check_number, check_vector
from sms_handover.errors import RobotDescriptionError
from sms_handover.types import Array

_AXIS_TOLERANCE = 1e-9  # [-] on the length of a joint axis
_TRIANGLE_TOLERANCE = 1e-9  # [-] relative; a flat body fulfils the inequality with equality

number = partial(check_number, error=RobotDescriptionError)
vector = partial(check_vector, error=RobotDescriptionError)


def check_unit_axis(axis: Sequence[float], what: str) -> None:
    """Raise RobotDescriptionError unless ``axis`` (3,) has length 1."""
    length = sqrt(sum(component**2 for component in axis))
    if abs(length - 1.0) > _AXIS_TOLERANCE:
        raise RobotDescriptionError(f"{what} {list(axis)} has length {length:.9g}, must be 1")


def check_position_limits(lower: float, upper: float, what: str) -> None:
    """Raise RobotDescriptionError unless both (rad) are finite and lower < upper."""
    vector((lower, upper), 2, what, "rad")
    if lower >= upper:
        raise RobotDescriptionError(f"{what} is [{lower}, {upper}] rad, must be lower < upper")


def check_moments(moments: Sequence[float], what: str) -> None:
    """Raise RobotDescriptionError unless ``moments`` (kg m^2) are those of a real body.

    ``moments`` are the entries ixx ixy ixz iyy iyz izz of the inertia matrix about the centre of
    mass. The principal moments must be positive and none may exceed the sum of the other two, as
    their integrals over mass demand.
    """
    smallest, middle, largest = (float(value) for value in np.linalg.eigvalsh(moment_matrix(moments)))
    principal = f"principal moments {smallest:.6g}, {middle:.6g}, {largest:.6g} kg m^2"
    if smallest <= 0.0:
        raise RobotDescriptionError(f"{what} has {principal}, all must be > 0")
    if largest > (smallest + middle) * (1.0 + _TRIANGLE_TOLERANCE):
        raise RobotDescriptionError(f"{what} has {principal}, none may exceed the sum of the other two")


def moment_matrix(moments: Sequence[float]) -> Array:
    """Return the symmetric (3, 3) matrix of ixx ixy ixz iyy iyz izz."""
    ixx, ixy, ixz, iyy, iyz, izz = moments
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=np.float64)
