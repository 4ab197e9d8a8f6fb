"""Decimation of a long series for drawing that keeps its visible shape."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from sms_handover.errors import ConfigurationError
from sms_handover.types import Array

_EXTREMES = 2  # samples kept of a bucket: its smallest and its largest value
_GAPS = 3  # further samples where there is NaN: one before, between and after the extremes
FEWEST_POINTS = 2 + _EXTREMES + _GAPS  # the two ends, and one bucket


def decimate(time: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Return at most ``points`` samples of a series (N,) that draw the same picture, in the order of time.

    The samples between the first and the last are split into buckets of equal count. Kept are the first
    and the last sample, the smallest and the largest value of each bucket, and enough NaN that a line
    never bridges a gap. A series of at most ``points`` samples is returned unchanged. Raises
    ConfigurationError for fewer than 7 points, or if time and values differ in length.
    """
    if time.ndim != 1 or time.shape != values.shape:
        raise ConfigurationError(f"time {time.shape} and values {values.shape} must both have the shape (N,)")
    if points < FEWEST_POINTS:
        raise ConfigurationError(f"points is {points}, it must be >= {FEWEST_POINTS}")
    if len(values) <= points:
        return time, values
    unknown = np.isnan(values)
    per_bucket = _EXTREMES + (_GAPS if np.any(unknown) else 0)
    buckets = (points - 2) // per_bucket
    edges = [1 + (len(values) - 2) * edge // buckets for edge in range(buckets + 1)]
    kept = [0, len(values) - 1]
    for begin, end in pairwise(edges):
        kept += [begin + place for place in _of_bucket(values[begin:end], unknown[begin:end])]
    chosen = np.array(sorted(kept), dtype=np.int64)
    return time[chosen], values[chosen]


def _of_bucket(values: Array, unknown: npt.NDArray[np.bool_]) -> set[int]:
    """Return the indices of the extremes of a bucket, and of one NaN in each part between them."""
    if np.all(unknown):
        return {0}
    low = int(np.argmin(np.where(unknown, np.inf, values)))
    high = int(np.argmax(np.where(unknown, -np.inf, values)))
    kept = {low, high}
    if np.any(unknown):
        ends = (0, min(kept), max(kept), len(values))
        for begin, end in pairwise(ends):
            kept |= {begin + int(place) for place in np.flatnonzero(unknown[begin:end])[:1]}
    return kept
