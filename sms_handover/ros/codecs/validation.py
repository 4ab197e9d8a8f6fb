"""Validation of the numbers of a message, cheap enough for every message of a loop of 1 kHz."""

from math import isfinite

import numpy as np

from sms_handover.errors import MessageError, Reason
from sms_handover.types import Array

_UNIT_TOLERANCE = 1e-6  # [-] on the squared length of a quaternion; single precision stays within


def check_finite(values: Array, what: str) -> None:
    """Raise MessageError if one of the values (n,) is NaN or infinite.

    The sum of the squares is finite only if all values are; only where it is not are they looked at.
    """
    if not isfinite(values.dot(values)) and not np.isfinite(values).all():
        raise MessageError(Reason.NOT_FINITE, f"{what} is not finite")


def check_unit(quaternion_xyzw: Array, what: str) -> None:
    """Raise MessageError if a quaternion (4,) is no rotation: its length differs from 1."""
    squared = quaternion_xyzw.dot(quaternion_xyzw)
    if not abs(squared - 1.0) <= _UNIT_TOLERANCE:
        raise MessageError(
            Reason.NOT_UNIT, f"{what} has a quaternion of length {np.sqrt(squared):.6g}, must be 1"
        )
