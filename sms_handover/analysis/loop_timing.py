"""Timing of the loop in a recorded run."""

from dataclasses import dataclass
from math import nan, sqrt

import numpy as np

from sms_handover.analysis.numbers import largest
from sms_handover.bag.run.loop_record import LoopRecord
from sms_handover.units import NS_PER_S, ns_to_seconds

_TAIL = 99.0  # [%] percentile of the periods that is reported


@dataclass(frozen=True)
class LoopTiming:
    """Wall time of a run, in s; NaN where it was not recorded.

    From the states as the recorder received them: ``wall_duration`` from the first to the last,
    ``real_time_factor`` simulated over wall time, ``largest_lag`` of the simulation behind the wall
    clock, and median and 99th percentile of the period between states, ``period_median`` and
    ``period_tail``. As measured by the plant: ``period_mean``, ``period_std`` and ``period_max``
    between ticks; the number of ``late_ticks``, which began more than a tick after their deadline, and
    of ``held_commands``, ticks integrated with an old command; both occur in real time only.
    """

    wall_duration: float
    real_time_factor: float
    largest_lag: float
    period_median: float
    period_tail: float
    period_mean: float
    period_std: float
    period_max: float
    late_ticks: float
    held_commands: float


def loop_timing(record: LoopRecord) -> LoopTiming:
    """Return the timing of a loop."""
    walls, stamps = record.wall, record.tick_ns
    periods = np.diff(walls)
    wall = float(walls[-1]) if periods.size else nan
    simulated = ns_to_seconds(int(stamps[-1] - stamps[0])) if periods.size else nan
    lag = walls - (stamps - stamps[:1]) / NS_PER_S
    mean, std = _pooled(record)
    return LoopTiming(
        wall_duration=wall,
        real_time_factor=simulated / wall if wall > 0.0 else nan,
        largest_lag=largest(lag),
        period_median=float(np.median(periods)) if periods.size else nan,
        period_tail=float(np.percentile(periods, _TAIL)) if periods.size else nan,
        period_mean=mean,
        period_std=std,
        period_max=largest(record.period_max),
        late_ticks=largest(record.late_ticks),
        held_commands=largest(record.held_commands),
    )


def _pooled(record: LoopRecord) -> tuple[float, float]:
    """Return mean and standard deviation in s of all periods, pooled over the plant's reports."""
    counts = np.diff(record.ticks, prepend=0.0)
    total = float(counts.sum())
    if not total > 0.0:
        return nan, nan
    mean = float(counts @ record.period_mean) / total
    squares = float(counts @ (record.period_std**2 + record.period_mean**2)) / total
    return mean, sqrt(max(squares - mean * mean, 0.0))
