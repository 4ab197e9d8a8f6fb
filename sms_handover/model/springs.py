"""Springs and dampers of passive joints: their torque, their energy, and what the dampers take."""

from dataclasses import dataclass

import numpy as np

from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class Springs:
    """Of p passive joints, the last of a robot: ``stiffness`` (p,) N m/rad and ``damping`` (p,) N m s/rad."""

    stiffness: Array
    damping: Array

    def __post_init__(self) -> None:
        freeze(self, "stiffness", "damping")

    def __len__(self) -> int:
        return self.stiffness.size

    def torque(self, q: Array, v: Array) -> Array:
        """Return -k q - c q' (p,) N m at a configuration and velocity of the robot, whose ends are theirs."""
        count = self.stiffness.size
        result: Array = -self.stiffness * q[-count:] - self.damping * v[-count:]
        return result

    def energy(self, angle: Array) -> Array:
        """Return sum k q^2 / 2 in J at angles (..., p) rad."""
        result: Array = 0.5 * np.add.reduce(self.stiffness * angle * angle, axis=-1)
        return result

    def taken(self, start: tuple[Array, Array], end: tuple[Array, Array], h: float) -> float:
        """Return what the dampers take in J over a step of ``h`` s, from q and v at its ends.

        int c q'^2 dt, with q' the parabola of the rates at both ends and of the mean rate: of order 4.
        """
        count = self.stiffness.size
        first, last = start[1][-count:], end[1][-count:]
        mean = (end[0][-count:] - start[0][-count:]) / h
        bulge = mean - 0.5 * (first + last)
        squares = (first * first + first * last + last * last) / 3.0
        squares = squares + bulge * (first + last) + 1.2 * bulge * bulge
        return float(h * np.add.reduce(self.damping * squares))
