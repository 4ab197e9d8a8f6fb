"""Gyro of the base: its angular velocity with noise of a given density, and a bias."""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from sms_handover.conditions.sensors.sensor import EMPTY, Known, Memory, Reading, Setting, Truth, in_ticks
from sms_handover.types import BASE_NV, Array, freeze
from sms_handover.units import ns_to_seconds

GYRO = "gyro"
_STREAM = "sensors.gyro"
_AXES = 3


@dataclass(frozen=True, eq=False)
class GyroValues:
    """A gyro: ``noise_density`` rad/s/sqrt(Hz), the square root of the two-sided power spectral density.

    ``bias`` (3,) rad/s in axes of base_link; ``period`` s between two readings, 0 for every tick.
    """

    noise_density: float
    bias: Array
    period: float

    def __post_init__(self) -> None:
        freeze(self, "bias")

    def check(self, tick_ns: int) -> None:
        """Raise ConfigurationError unless the period is a multiple of the tick."""
        in_ticks(self.period, tick_ns, "gyro.period")

    def make(self, setting: Setting) -> "Gyro":
        """Return the gyro of a run."""
        return Gyro(self, setting)


class Gyro:
    """Angular velocities w + b + D n / sqrt(T), each held for its period T; n is standard normal.

    Their sum times T varies by D^2 t, which data sheets call the angle random walk, whatever the period
    [IEEE952].
    """

    def __init__(self, values: GyroValues, setting: Setting) -> None:
        self._bias = values.bias
        self._asked, self._tick_ns = in_ticks(values.period, setting.tick_ns, "gyro.period"), setting.tick_ns
        self._every = max(1, self._asked)
        self._period = self._every * setting.tick_s
        self._sigma = values.noise_density / sqrt(self._period)  # rad/s
        self._variance = np.full(_AXES, self._sigma**2)
        self._noise = setting.streams.noise(_STREAM, _AXES)
        self.reset()

    @property
    def applied(self) -> dict[str, Any]:
        """The values by which it computes, rad/s/sqrt(Hz), rad/s and s."""
        density, period = self._sigma * sqrt(self._period), ns_to_seconds(self._asked * self._tick_ns)
        return {"noise_density": density, "bias": self._bias, "period": period}

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.memory = EMPTY

    def measure(self, truth: Truth, known: Known) -> Reading | None:
        """Put the latest reading in the place of the angular velocity of the base."""
        reading = None
        if truth.tick % self._every == 0:
            rate = truth.v[3:BASE_NV] + self._bias + self._sigma * self._noise.normal(truth.tick)
            before = self.memory.held
            known.turned = self._period * before if before.size else np.zeros(_AXES)
            self.memory = Memory(rate)
            reading = Reading(GYRO, truth.tick, rate, self._variance)
        known.v[3:BASE_NV] = self.memory.held
        return reading
