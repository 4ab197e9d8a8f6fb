"""Star tracker of the base: its orientation now and then, and late; a gyro goes on from there."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sms_handover.conditions.sensors.delay_line import DelayLine
from sms_handover.conditions.sensors.sensor import Known, Memory, Reading, Setting, Truth
from sms_handover.conditions.sensors.turns import IDENTITY, by, numbers_of, quaternion_of
from sms_handover.types import BASE_NQ, Array, freeze

STAR_TRACKER = "star_tracker"
_STREAM = "sensors.star_tracker"
_AXES = 3
_TURNED, _ORIENTATION_NOW = slice(0, 4), slice(4, 8)  # in the numbers held
_ORIENTATION, _TURNED_THEN = slice(0, 4), slice(4, 8)  # in those of a sample


@dataclass(frozen=True, eq=False)
class StarTrackerValues:
    """A star tracker: ``noise`` rad about each axis, ``bias`` (3,) rad, a rotation vector in base_link.

    It measures each ``period`` s, and gives a result ``latency`` s later.
    """

    noise: float
    bias: Array
    period: float
    latency: float

    def __post_init__(self) -> None:
        freeze(self, "bias")

    def check(self, tick_ns: int) -> None:
        """Raise ConfigurationError unless period and latency are multiples of the tick."""
        self.line(tick_ns)

    def line(self, tick_ns: int) -> DelayLine:
        """Return when it measures; raises ConfigurationError."""
        return DelayLine(STAR_TRACKER, self.period, self.latency, tick_ns)

    def make(self, setting: Setting) -> "StarTracker":
        """Return the star tracker of a run."""
        return StarTracker(self, setting)


class StarTracker:
    """Orientations Q exp(s n + b); n is standard normal, drawn for each.

    Known is the latest one, turned on by the gyro since then: Q exp(w(1) T) exp(w(2) T) ..., with readings w
    each held for its period T [Markley2014]; without a gyro it is held.
    """

    def __init__(self, values: StarTrackerValues, setting: Setting) -> None:
        self._values = values
        self._line = values.line(setting.tick_ns)
        self._variance = np.concatenate([np.zeros(_AXES), np.full(_AXES, values.noise**2)])
        self._noise = setting.streams.noise(_STREAM, _AXES)
        self.reset()

    @property
    def applied(self) -> dict[str, Any]:
        """The values by which it computes, rad and s."""
        return {"noise": self._values.noise, "bias": self._values.bias, **self._line.applied}

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.memory = Memory(np.array([*IDENTITY, *IDENTITY]))

    def measure(self, truth: Truth, known: Known) -> Reading | None:
        """Put what is known of the orientation in the place of the true one."""
        tick, line, turned = truth.tick, self._line, self.memory.held[_TURNED]
        if known.turned is not None:
            turned = numbers_of(quaternion_of(turned) * by(known.turned))
        memory = self.memory
        if line.measures(tick):
            error = self._values.noise * self._noise.normal(tick) + self._values.bias
            seen = numbers_of(quaternion_of(truth.q[3:BASE_NQ]) * by(error))
            memory = line.put(memory, tick, np.concatenate([seen, turned]))
        memory, came = line.arriving(memory, tick)
        if came or known.turned is not None or tick == 0:
            memory = Memory(np.concatenate([turned, _since(memory, turned)]), memory.waiting, memory.latest)
        self.memory = memory
        known.q[3:BASE_NQ] = memory.held[_ORIENTATION_NOW]
        if came is None:
            return None
        pose = np.concatenate([truth.q[:3], came.values[_ORIENTATION]])
        return Reading(STAR_TRACKER, came.tick, pose, self._variance)


def _since(memory: Memory, turned: Array) -> Array:
    """Return the latest orientation (4,), turned on by what a gyro has measured since it was."""
    if memory.latest is None:
        raise AssertionError("a star tracker measures in the first tick")
    values = memory.latest.values
    since = quaternion_of(values[_TURNED_THEN]).conjugate() * quaternion_of(turned)
    return numbers_of(quaternion_of(values[_ORIENTATION]) * since)
