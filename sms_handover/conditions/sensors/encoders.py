"""Encoders: the angles of the joints in steps, and rates by a filtered difference of them."""

from dataclasses import dataclass
from math import exp, isfinite
from typing import Any

import numpy as np

from sms_handover.conditions.sensors.sensor import EMPTY, Known, Memory, Setting, Truth
from sms_handover.types import BASE_NQ, BASE_NV, Array, freeze

ENCODERS = "encoders"


@dataclass(frozen=True, eq=False)
class EncoderValues:
    """Encoders of the joints: ``step`` (n,) rad, 0 for none; ``offset`` (n,) rad of the zero of each.

    ``bandwidth`` 1/s is that of the filter of the rates, infinite without one.
    """

    step: Array
    offset: Array
    bandwidth: float

    def __post_init__(self) -> None:
        freeze(self, "step", "offset")

    def check(self, tick_ns: int) -> None:
        """Accept any tick."""

    def make(self, setting: Setting) -> "Encoders":
        """Return the encoders of a run."""
        return Encoders(self, setting)


class Encoders:
    """Angles p = d round((q + b) / d), and rates w(k) = a w(k-1) + (1 - a) (p(k) - p(k-1)) / h.

    With a = exp(-c h), the zero-order hold of a low pass c / (s + c) [Franklin1998]; at first the joints
    rest. Nothing here is random.
    """

    def __init__(self, values: EncoderValues, setting: Setting) -> None:
        self._offset, self._bandwidth, self._h = values.offset, values.bandwidth, setting.tick_s
        self._stepped = values.step > 0.0
        self._step = np.where(self._stepped, values.step, 1.0)
        self._kept = exp(-self._bandwidth * self._h)
        self._n = setting.joints
        self.reset()

    @property
    def applied(self) -> dict[str, Any]:
        """The values by which they compute, rad and 1/s; without a filter there is no bandwidth."""
        found = {"step": np.where(self._stepped, self._step, 0.0), "offset": self._offset}
        return {**found, "bandwidth": self._bandwidth} if isfinite(self._bandwidth) else found

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.memory = EMPTY

    def measure(self, truth: Truth, known: Known) -> None:
        """Put measured angles and rates in the place of the true ones."""
        shifted = truth.q[BASE_NQ:] + self._offset
        position = np.where(self._stepped, self._step * np.round(shifted / self._step), shifted)
        held = self.memory.held
        if held.size:
            difference = (position - held[: self._n]) / self._h
            velocity = self._kept * held[self._n :] + (1.0 - self._kept) * difference
        else:
            velocity = np.zeros(self._n)
        self.memory = Memory(np.concatenate([position, velocity]))
        known.q[BASE_NQ:], known.v[BASE_NV:] = position, velocity
