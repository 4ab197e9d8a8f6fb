"""Vision: the pose of the deputy by a camera on the base, noisier with range, now and then, and late."""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from sms_handover.conditions.sensors.delay_line import DelayLine
from sms_handover.conditions.sensors.sensor import EMPTY, Known, Reading, Setting, Truth
from sms_handover.conditions.sensors.turns import by, numbers_of, quaternion_of
from sms_handover.types import BASE_NQ, Array, Pose, freeze, frozen

VISION = "vision"
_STREAM = "sensors.vision"
_AXES = 3
_SEEN, _VARIANCE, _IN_WORLD = slice(0, 7), slice(7, 13), slice(13, 20)  # in the numbers of a sample


@dataclass(frozen=True, eq=False)
class VisionValues:
    """A camera at ``camera`` (3,) m in base_link that measures the pose of the deputy in base_link.

    ``position_noise`` m and ``angle_noise`` rad about each axis are those per metre of range;
    ``position_bias`` (3,) m and ``angle_bias`` (3,) rad, a rotation vector, are in axes of base_link. It
    measures each ``period`` s and gives a result ``latency`` s later, or with the probability ``dropped``
    none.
    """

    position_noise: float
    angle_noise: float
    position_bias: Array
    angle_bias: Array
    period: float
    latency: float
    dropped: float
    camera: Array

    def __post_init__(self) -> None:
        freeze(self, "position_bias", "angle_bias", "camera")

    def check(self, tick_ns: int) -> None:
        """Raise ConfigurationError unless period and latency are multiples of the tick."""
        self.line(tick_ns)

    def line(self, tick_ns: int) -> DelayLine:
        """Return when it measures; raises ConfigurationError."""
        return DelayLine(VISION, self.period, self.latency, tick_ns)

    def make(self, setting: Setting) -> "Vision":
        """Return the camera of a run."""
        return Vision(self, setting)


class Vision:
    """Poses p + s_p r n + b_p, exp(s_a r m + b_a) R of the deputy in base_link, at a range r of the camera.

    n and m are standard normal, drawn for each: an error of a pixel spans a length in proportion to the range
    [Hartley2004]. Known is the latest pose, brought to ``world`` by what was known of the base as it was
    measured, and held.
    """

    def __init__(self, values: VisionValues, setting: Setting) -> None:
        self._values = values
        self._line = values.line(setting.tick_ns)
        self._noise = setting.streams.noise(_STREAM, 2 * _AXES)
        self.reset()

    @property
    def applied(self) -> dict[str, Any]:
        """The values by which it computes: m, rad, s, and those per metre of range."""
        return {**vars(self._values), **self._line.applied}

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.memory = EMPTY

    def measure(self, truth: Truth, known: Known) -> Reading | None:
        """Say where the deputy is, as far as it is known."""
        tick, line, memory = truth.tick, self._line, self.memory
        if line.measures(tick):
            lost = bool(self._noise.uniform(tick)[0] < self._values.dropped)
            memory = line.put(memory, tick, self._sample(truth, known), lost=lost)
        self.memory, came = line.arriving(memory, tick)
        if self.memory.latest is None:
            raise AssertionError("a camera measures in the first tick")
        row = self.memory.latest.values[_IN_WORLD]
        known.deputy_in_world = Pose(row[:3], row[3:])
        if came is None:
            return None
        return Reading(VISION, came.tick, came.values[_SEEN], came.values[_VARIANCE])

    def _sample(self, truth: Truth, known: Known) -> Array:
        """Return the pose in base_link (7,), its variances (6,), and the pose in ``world`` (7,)."""
        values, noise = self._values, self._noise.normal(truth.tick)
        deputy, base = truth.deputy_in_world(), quaternion_of(truth.q[3:BASE_NQ])
        position = base.conjugate() * (deputy.position - truth.q[:3])
        dx, dy, dz = (position - values.camera).tolist()
        distance = sqrt(dx * dx + dy * dy + dz * dz)
        far, askew = values.position_noise * distance, values.angle_noise * distance  # m, rad
        seen_at = position + far * noise[:_AXES] + values.position_bias
        turn = by(askew * noise[_AXES:] + values.angle_bias)
        seen = turn * base.conjugate() * quaternion_of(deputy.quaternion_xyzw)
        believed = quaternion_of(known.q[3:BASE_NQ])
        at = known.q[:3] + believed * seen_at
        variance = [far**2] * _AXES + [askew**2] * _AXES
        parts = [seen_at, numbers_of(seen), variance, at, numbers_of(believed * seen)]
        return frozen(np.concatenate(parts))
