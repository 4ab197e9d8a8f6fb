"""Protocol of a second engine: what it is given of a run, and the motion that it answers with."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sms_handover.types import Array, freeze


class Effect(Enum):
    """What moves a robot beyond its efforts and the inertia of its links; the value names it to the user."""

    ROTOR_INERTIA = "rotor inertia"
    JOINT_STOPS = "joint stops"


@dataclass(frozen=True, eq=False)
class Replay:
    """What moved a robot in a recorded run: its description, where it started, and every effort.

    ``urdf`` describes the robot, with what motors add, ``rotor_inertia`` kg m^2 by joint, which a URDF cannot
    say. ``start_q`` (7 + n,) and ``start_v`` (6 + n,) are as in RobotState; row k of ``efforts`` (N, n) N m
    was held over tick k of ``tick_ns``, joints in the order of ``joint_names``. ``samples`` (K,) are the
    numbers of the states to compare, in rising order; 0 is the start, N the last. ``effects`` are those that
    an engine has to know beyond that.
    """

    urdf: str
    rotor_inertia: Mapping[str, float]
    joint_names: tuple[str, ...]
    arms: tuple[str, ...]
    tick_ns: int
    start_q: Array
    start_v: Array
    efforts: Array
    samples: npt.NDArray[np.int64]
    effects: frozenset[Effect]

    def __post_init__(self) -> None:
        freeze(self, "start_q", "start_v", "efforts")
        self.samples.setflags(write=False)
        object.__setattr__(self, "rotor_inertia", MappingProxyType(dict(self.rotor_inertia)))


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion that an engine computed, a row per sample, by its own kinematics and its own sums.

    ``q`` (K, 7 + n); ``tools`` (K, 7) by arm, position and quaternion x y z w in ``world``; the momenta
    (K, 3) in ``world`` axes, the angular one about the centre of mass.
    """

    q: Array
    tools: Mapping[str, Array]
    linear_momentum: Array
    angular_momentum: Array

    def __post_init__(self) -> None:
        freeze(self, "q", "linear_momentum", "angular_momentum")
        object.__setattr__(self, "tools", MappingProxyType(dict(self.tools)))


class Engine(Protocol):
    """Another program that integrates the equations of motion."""

    @property
    def title(self) -> str:
        """Its name and version."""

    @property
    def lacks(self) -> Mapping[Effect, str]:
        """The effects that it cannot replay, and why."""

    def run(self, replay: Replay) -> Motion:
        """Integrate a replay without an effect that it lacks."""
