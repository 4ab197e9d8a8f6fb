"""Percentiles of a metric over cases, with bootstrap intervals."""

from typing import NamedTuple

import numpy as np

from sms_handover.campaign.sampling.designs import needed
from sms_handover.types import Array

_RESAMPLES = 200  # [-]
_SEED = 0  # of the resampling, so that a page is the same each time
_MOST = 20_000  # [-] values that are resampled; of more a part, evenly taken


class Percentile(NamedTuple):
    """A percentile of so many values, and the bounds of its 95 % bootstrap interval, NaN of too few."""

    value: float
    low: float
    high: float
    known: int


def percentile(values: Array, share: float) -> Percentile:
    """Return the percentile of a share in (0, 1) of the values (N,) that are not NaN.

    Raises MissingDependencyError without scipy.
    """
    known = values[~np.isnan(values)]
    if known.size == 0:
        return Percentile(np.nan, np.nan, np.nan, 0)
    value = float(np.quantile(known, share))
    if known.size < 2 or np.ptp(known) == 0.0:
        return Percentile(value, np.nan, np.nan, known.size)
    sample = known[:: max(1, known.size // _MOST)]
    interval = (
        needed("scipy.stats", "scipy")
        .bootstrap(
            (sample,),
            lambda data, axis: np.quantile(data, share, axis=axis),
            n_resamples=_RESAMPLES,
            batch=50,
            method="percentile",
            random_state=np.random.default_rng(_SEED),
        )
        .confidence_interval
    )
    return Percentile(value, float(interval.low), float(interval.high), known.size)
