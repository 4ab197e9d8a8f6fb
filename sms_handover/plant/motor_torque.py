"""Motor torque: what the motors give in place of the torque that they are asked for."""

from math import sqrt

import numpy as np

from sms_handover.conditions.joint_values import TorqueErrors
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.types import Array, frozen

_NAME = "torque.noise_density"


class MotorTorque:
    """Torques of the motors over ticks of ``h`` s: (1 + g) d round(u / d) + b + D n / sqrt(h).

    n is standard normal and held over a tick. Below half the rate of the ticks the noise has the two-sided
    density D^2 whatever the tick: the angular momentum that it leads to varies by D^2 t. A data sheet with a
    one-sided density says sqrt(2) D.
    """

    def __init__(self, errors: TorqueErrors, h: float, streams: RandomStreams) -> None:
        self._factor, self._offset = 1.0 + errors.gain, errors.offset
        self._stepped = errors.step > 0.0
        self._step = np.where(self._stepped, errors.step, 1.0)
        self._sigma = errors.noise_density / sqrt(h)  # N m
        self._noise = streams.noise(_NAME, errors.gain.size)

    def given(self, tick: int, command: Array) -> Array:
        """Return the torques (n,) N m in a tick under a command (n,) N m."""
        rounded = np.where(self._stepped, self._step * np.round(command / self._step), command)
        return frozen(self._factor * rounded + self._offset + self._sigma * self._noise.normal(tick))
