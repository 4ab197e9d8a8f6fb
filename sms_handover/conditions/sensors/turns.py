"""Turns as quaternions x y z w, for what sensors add to an orientation."""

import numpy as np
import pinocchio as pin

from sms_handover.types import Array

IDENTITY = (0.0, 0.0, 0.0, 1.0)


def by(rotation_vector: Array) -> pin.Quaternion:
    """Return the turn of a rotation vector (3,) rad."""
    return pin.Quaternion(pin.exp3(rotation_vector))


def quaternion_of(xyzw: Array) -> pin.Quaternion:
    """Return four numbers as a quaternion of length 1."""
    return pin.Quaternion(np.asarray(xyzw)).normalized()


def numbers_of(quaternion: pin.Quaternion) -> Array:
    """Return a quaternion as numbers (4,)."""
    return np.array(quaternion.normalized().coeffs())
