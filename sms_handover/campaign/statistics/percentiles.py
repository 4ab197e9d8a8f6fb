"""Percentiles of a metric over cases, with intervals by order statistics [Hahn1991]."""

from typing import NamedTuple

import numpy as np

from sms_handover.campaign.sampling.designs import needed
from sms_handover.types import Array

_TAIL = 0.025  # [-] chance that the percentile is beyond either bound, at most
SHARES = (0.05, 0.5, 0.95)


class Percentile(NamedTuple):
    """A percentile of so many values, and the bounds of its 95 % interval, NaN of too few values."""

    value: float
    low: float
    high: float
    known: int


def percentile(values: Array, share: float) -> Percentile:
    """Return the percentile of a share in (0, 1) of the values (N,) that are not NaN.

    How many of N independent values are below the percentile is binomial, of whatever distribution they
    are. Bounds are therefore two of the sorted values, x_(l) and x_(u), the innermost with
    P(B <= l - 1) <= 2.5 % and P(B >= u) <= 2.5 % for B of Bin(N, share) [Hahn1991, chapter 5]: they
    hold the percentile in at least 95 % of all samples. Below :func:`least_cases` there are none.

    Raises MissingDependencyError without scipy.
    """
    known = values[~np.isnan(values)]
    if known.size == 0:
        return Percentile(np.nan, np.nan, np.nan, 0)
    value = float(np.quantile(known, share))
    binomial = needed("scipy.stats", "scipy").binom
    low = int(binomial.ppf(_TAIL, known.size, share)) - 1  # places of the sorted values, from 0
    high = int(binomial.isf(_TAIL, known.size, share))
    if low < 0 or high >= known.size:
        return Percentile(value, np.nan, np.nan, known.size)
    placed = np.partition(known, (low, high))
    return Percentile(value, float(placed[low]), float(placed[high]), known.size)


def least_cases(share: float) -> int:
    """Return from how many values on a percentile has an interval: all of fewer are too likely on one side.

    That is the least N with max(share, 1 - share)^N <= 2.5 %.
    """
    return int(np.ceil(np.log(_TAIL) / np.log(max(share, 1.0 - share))))
