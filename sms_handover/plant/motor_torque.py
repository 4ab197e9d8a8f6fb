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
        self.factor, self.offset, self.step = 1.0 + errors.gain, errors.offset, errors.step
        self._stepped = errors.step > 0.0
        self.divisor = np.where(self._stepped, errors.step, 1.0)
        self._h = h
        self._sigma = errors.noise_density / sqrt(h)  # N m
        self._noise = streams.noise(_NAME, errors.gain.size)
        self._noisy = bool(np.any(self._sigma))

    @property
    def applied(self) -> dict[str, Array]:
        """The errors (n,) by which it computes, by name."""
        step = np.where(self._stepped, self.divisor, 0.0)
        density = self._sigma * sqrt(self._h)
        return {"gain": self.factor - 1.0, "offset": self.offset, "step": step, "noise_density": density}

    def given(self, tick: int, command: Array) -> Array:
        """Return the torques (n,) N m in a tick under a command (n,) N m."""
        rounded = np.where(self._stepped, self.divisor * np.round(command / self.divisor), command)
        return frozen(self.factor * rounded + self.offset + self.noise(tick, 1)[0])

    def noise(self, first: int, ticks: int) -> Array:
        """Return the noise (ticks, n) N m of some ticks from a first one on."""
        if not self._noisy:
            return np.zeros((ticks, self._sigma.size))
        normals = self._noise.normals(first, ticks)
        return np.multiply(self._sigma, normals, out=normals)
