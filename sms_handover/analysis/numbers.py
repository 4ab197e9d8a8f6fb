"""Operations on arrays of recorded numbers, in which NaN stands for a value that was not recorded."""

from math import nan

import numpy as np
import numpy.typing as npt

from sms_handover.types import Array


def largest(values: npt.ArrayLike) -> float:
    """Return the largest value that is not NaN, NaN if there is none."""
    array = np.asarray(values, dtype=np.float64)
    known = array[~np.isnan(array)]
    return float(known.max()) if known.size else nan


def mean(values: npt.ArrayLike) -> float:
    """Return the mean of the values, NaN if there are none."""
    array = np.asarray(values, dtype=np.float64)
    return float(array.mean()) if array.size else nan


def lengths(rows: Array) -> Array:
    """Return the Euclidean norm of every row."""
    result: Array = np.sqrt(np.sum(rows * rows, axis=-1))
    return result


def complete(*tables: Array) -> npt.NDArray[np.bool_]:
    """Return whether each row is finite in all tables."""
    return np.asarray(np.all([np.all(np.isfinite(table), axis=1) for table in tables], axis=0))


def angle_between(a: Array, b: Array) -> Array:
    """Return the angles in rad of the rotations from ``a`` to ``b``, quaternions (..., 4) x y z w.

    2 atan2(|v|, |w|) of the relative quaternion (v, w): precise near zero, and the same for q and -q.
    """
    return lengths(rotation_vectors(a, b))


def rotation_vectors(a: Array, b: Array) -> Array:
    """Return the rotation vectors (..., 3) in rad from ``a`` to ``b``, quaternions x y z w.

    They are expressed in the axes in which ``a`` and ``b`` are given, and at most pi long: v/|v| times
    2 atan2(|v|, |w|) of the quaternion (v, w) of b conj(a), precise near zero, and the same for q and -q.
    """
    a_v, a_w, b_v, b_w = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    vector = a_w * b_v - b_w * a_v + np.cross(a_v, b_v)
    scalar = np.sum(a * b, axis=-1, keepdims=True)
    length = lengths(vector)[..., np.newaxis]
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    factor = np.divide(angle, length, out=np.zeros(length.shape), where=length > 0.0)
    result: Array = np.where(scalar < 0.0, -factor, factor) * vector
    return result
