"""Complementarity problems of contacts and saturations: small, symmetric and solved exactly."""

import eigenpy
import numpy as np
import numpy.typing as npt

from sms_handover.types import Array

_LOWER, _BETWEEN, _UPPER = range(3)
_EPS = float(np.finfo(float).eps)
_PIVOTS_PER_ROW = 50  # [-] a few are needed; more means that rounding alternates between two equal solutions


def solve_bounded(
    matrix: Array, offset: Array, upper: Array, between_first: npt.NDArray[np.bool_] | None = None
) -> Array:
    """Return x (k,) in [0, upper] with w = M x + offset >= 0 where x = 0, <= 0 where x = upper, 0 between.

    Principal pivoting with the least-index rule [Murty1974] for bounded variables [Judice1992]: the first
    entry that violates its sign changes sides, until none does. ``matrix`` (k, k) is symmetric and positive
    definite, so there is one solution, and a finite number of pivots leads to it. The order of pivots and
    sums is fixed. An entry of ``upper`` (k,) may be infinite. Pivoting begins with the entries of
    ``between_first`` (k,) between their bounds and the others at 0: a good guess saves pivots.
    """
    size = offset.size
    side = np.full(size, _LOWER)
    if between_first is not None:
        side[between_first] = _BETWEEN
    x = np.zeros(size)
    for _ in range(_PIVOTS_PER_ROW * size):
        x = np.where(side == _UPPER, upper, 0.0)
        between = np.flatnonzero(side == _BETWEEN)
        if between.size:
            right = -(offset + product(matrix, x))[between]
            x[between] = eigenpy.LLT(matrix[np.ix_(between, between)]).solve(right)
        w = offset + product(matrix, x)
        rounding = size * _EPS * (np.abs(offset) + product(np.abs(matrix), x))
        target = np.where(x < 0.0, _LOWER, np.where(x > upper, _UPPER, side))
        target[(side == _LOWER) & (w < -rounding)] = _BETWEEN
        target[(side == _UPPER) & (w > rounding)] = _BETWEEN
        wrong = np.flatnonzero(target != side)
        if not wrong.size:
            break
        side[wrong[0]] = target[wrong[0]]
    return np.minimum(np.maximum(x, 0.0), upper)


def product(symmetric: Array, x: Array) -> Array:
    """Return M x (k,) of a symmetric M (k, k), summed row after row."""
    result: Array = np.add.reduce(symmetric * x[:, np.newaxis])
    return result
