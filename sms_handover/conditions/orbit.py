"""Orbit: gravity of the Earth along a circle, as it differs from point to point of a spacecraft."""

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, cross
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, freeze

_MU = 3.986004418e14  # [m^3/s^2] of the Earth, WGS 84
_ACROSS = 1e-9  # [-] of the cosine between two directions that are to be at right angles


@dataclass(frozen=True, eq=False)
class Orbit:
    """A circular orbit of ``radius`` m; ``world`` has its axes fixed among the stars and falls with it.

    ``radial`` (3,) is the direction from the Earth at 0 s, ``normal`` (3,) that of the orbital angular
    momentum. Raises ConfigurationError unless the two are at right angles.
    """

    radius: float
    radial: Array
    normal: Array

    def __post_init__(self) -> None:
        for name in ("radial", "normal"):
            vector = np.asarray(getattr(self, name), dtype=np.float64)
            length = float(np.linalg.norm(vector))
            if not length > 0.0:
                raise ConfigurationError(f"{name} is a vector of length 0, must be a direction")
            object.__setattr__(self, name, vector / length)
        freeze(self, "radial", "normal")
        cosine = float(self.radial @ self.normal)
        if abs(cosine) > _ACROSS:
            raise ConfigurationError(f"radial . normal is {cosine:g}, must be 0: they are at right angles")

    @property
    def rate(self) -> float:
        """The mean motion n = sqrt(mu / R^3) in rad/s."""
        return sqrt(_MU / self.radius**3)

    def direction(self, time_s: float) -> Array:
        """Return the direction (3,) from the Earth."""
        angle = self.rate * time_s
        across = cross(self.normal, self.radial)
        result: Array = cos(angle) * self.radial + sin(angle) * across
        return result


@dataclass(frozen=True, eq=False)
class GravityGradient:
    """The torque of gravity on a body that is not round: 3 n^2 r x (I r) about its centre [Hughes2004]."""

    orbit: Orbit

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over a tick: that of its middle."""
        r = self.orbit.direction(start_s + 0.5 * tick_s)
        return Wrench(np.zeros(3), 3.0 * self.orbit.rate**2 * cross(r, body.inertia @ r))


@dataclass(frozen=True, eq=False)
class RelativeOrbit:
    """Relative motion of two bodies in neighbouring orbits: m n^2 (3 r r^T - 1) x at the centre of mass.

    x is from ``reference`` (3,) m in ``world``, which moves along the orbit itself. In axes that turn with
    the orbit these are Hill's equations [Clohessy1960].
    """

    orbit: Orbit
    reference: Array

    def __post_init__(self) -> None:
        freeze(self, "reference")

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over a tick: that of its middle, at the place of its start."""
        r = self.orbit.direction(start_s + 0.5 * tick_s)
        away = body.centre - self.reference
        force = body.mass * self.orbit.rate**2 * (3.0 * float(r @ away) * r - away)
        return Wrench(force, cross(body.centre - body.origin, force))
