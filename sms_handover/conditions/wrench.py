"""Wrenches from outside on a body, and what they may depend on."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sms_handover.types import Array, freeze, frozen


@dataclass(frozen=True, eq=False)
class Wrench:
    """Force (3,) N and torque (3,) N m about the origin of the body, in ``world`` axes."""

    force: Array
    torque: Array

    def __post_init__(self) -> None:
        freeze(self, "force", "torque")

    def __add__(self, other: "Wrench") -> "Wrench":
        """Return the sum of two wrenches on one body."""
        return Wrench(self.force + other.force, self.torque + other.torque)


@dataclass(frozen=True, eq=False)
class BodyAtInstant:
    """A body, or the robot with what it holds as one, at an instant.

    ``origin`` (3,) m in ``world``; ``rotation`` (3, 3) of its axes in ``world``; ``mass`` kg; ``centre`` (3,)
    m of mass in ``world``; ``inertia`` (3, 3) kg m^2 about it in ``world`` axes.
    """

    origin: Array
    rotation: Array
    mass: float
    centre: Array
    inertia: Array


class WrenchModel(Protocol):
    """A wrench that is held over each tick."""

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench on a body over the tick that begins at ``start_s``."""


def cross(a: Array, b: Array) -> Array:
    """Return a x b (3,); ``np.cross`` takes twenty times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def at_point(force: Array, torque: Array, point: Array, axes: Array) -> Wrench:
    """Return the wrench of a force (3,) N at a point (3,) m of a body, and a torque (3,) N m.

    All are in axes whose rotation (3, 3) in ``world`` is given.
    """
    return Wrench(frozen(axes @ force), frozen(axes @ (torque + cross(point, force))))
