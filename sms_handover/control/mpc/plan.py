"""Plan of the joints: accelerations over a horizon, as a motion that can be sampled at any later time."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.types import Array, freeze
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Plan:
    """Joint angles and rates (n,) at ``begin_ns``, and accelerations (N, n) over the intervals (N,) s.

    ``number`` is that of the solve. After its end the joints stand still.
    """

    number: int
    begin_ns: int
    q: Array
    w: Array
    accelerations: Array
    intervals: Array

    def __post_init__(self) -> None:
        freeze(self, "q", "w", "accelerations", "intervals")

    @cached_property
    def horizon(self) -> Horizon:
        """The intervals as a horizon."""
        return Horizon(self.intervals)

    @cached_property
    def _nodes(self) -> tuple[Array, Array]:
        """Angles and rates (N + 1, n) at the instants of the horizon."""
        return self.horizon.motion(self.q, self.w, self.accelerations)

    @property
    def end_s(self) -> float:
        """How long the plan lasts, s."""
        return float(self.horizon.times[-1])

    def at(self, stamp_ns: int) -> Array:
        """Return q_d, q_d' and q_d'', the rows of (3, n), at a time; before the plan as where it begins."""
        return self.after(ns_to_seconds(stamp_ns - self.begin_ns))

    def after(self, elapsed: float) -> Array:
        """Return the same some seconds after the beginning."""
        motion = np.zeros((3, len(self.q)))
        angles, rates = self._nodes
        if elapsed >= self.end_s:
            motion[0] = angles[-1]
            return motion
        times = self.horizon.times
        k = max(int(np.searchsorted(times, elapsed, side="right")) - 1, 0)
        s = elapsed - times[k]
        motion[2] = self.accelerations[k]
        motion[1] = rates[k] + s * motion[2]
        motion[0] = angles[k] + s * rates[k] + 0.5 * s * s * motion[2]
        return motion

    def resampled(self, horizon: Horizon, begin_ns: int) -> Array:
        """Return the mean accelerations (N, n) over the intervals of a horizon that begins at a time."""
        since = ns_to_seconds(begin_ns - self.begin_ns)
        rates = np.array([self.after(since + time)[1] for time in horizon.times.tolist()])
        return np.diff(rates, axis=0) / horizon.intervals[:, None]
