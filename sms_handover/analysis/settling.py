"""Settling of an error within a band."""

from math import nan

import numpy as np
import numpy.typing as npt

from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import Stamps
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds

SETTLING_BAND = 0.02  # [-] of the step, the usual 2 % criterion
STEADY_PART = 0.1  # [-] of the phase, at its end, over which the steady-state error is averaged


def settling_time(stamp_ns: Stamps, error: Array, band: float, start_ns: int) -> float:
    """Return the time in s from ``start_ns`` after which an error stays within a band, NaN if it does not.

    It is the time of the first sample after the last one outside the band, so it is late by at most one
    sampling period.
    """
    outside = np.flatnonzero(error > band)
    if not error.size or (outside.size and outside[-1] == error.size - 1):
        return nan
    if not outside.size:
        return 0.0
    return ns_to_seconds(int(stamp_ns[outside[-1] + 1]) - start_ns)


def steady_rows(stamp_ns: Stamps, phase: PhaseSpan) -> npt.NDArray[np.bool_]:
    """Return whether each sample is in the part of the phase that counts as steady state."""
    length_ns = phase.end_ns - phase.start_ns
    return np.asarray(stamp_ns >= phase.end_ns - round(STEADY_PART * length_ns))
