"""Setpoint of the joints: the motion that the rates of one reference period give."""

from dataclasses import dataclass

import numpy as np

import sms_handover as sms

_S_PER_NS = 1e-9  # [s/ns]


@dataclass(frozen=True, eq=False)
class Setpoint:
    """Angles q rad and rates w rad/s at ``begin_ns``, rates ``reached`` at the end of a period; each (n,).

    Rates change linearly in the period and stay after it; beyond an age of ``longest_ns``, unless that is
    None, the joints stand still.
    """

    begin_ns: int
    q: sms.Array
    w: sms.Array
    reached: sms.Array
    period_ns: int
    longest_ns: int | None

    def at(self, stamp_ns: int) -> sms.Array:
        """Return q_d, q_d' and q_d'', the rows of (3, n), at a time."""
        age_ns = stamp_ns - self.begin_ns
        if self.longest_ns is not None and age_ns > self.longest_ns:
            stand = np.zeros((3, self.q.size))
            stand[0] = self.at(self.begin_ns + self.longest_ns)[0]
            return stand
        s, period = age_ns * _S_PER_NS, self.period_ns * _S_PER_NS
        acceleration = (self.reached - self.w) / period
        if age_ns < self.period_ns:
            rates = self.w + s * acceleration
            return np.array([self.q + 0.5 * s * (self.w + rates), rates, acceleration])
        end = self.q + 0.5 * period * (self.w + self.reached)
        return np.array([end + (s - period) * self.reached, self.reached, np.zeros_like(self.w)])
