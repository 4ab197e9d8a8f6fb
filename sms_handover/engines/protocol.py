"""Protocol of a second engine: what it is given of a run, and the motion that it answers with."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sms_handover.conditions.wrench import WrenchModel
from sms_handover.model.parts import Inertia
from sms_handover.types import Array, Pose, Twist, freeze


class Effect(Enum):
    """What moves a robot beyond its efforts and the inertia of its links; the value names it to the user."""

    ROTOR_INERTIA = "rotor inertia"
    JOINT_STOPS = "joint stops"
    DEPUTY_MASS = "a deputy with mass"
    WRENCHES = "wrenches from outside"
    DEPUTY_WRENCHES = "wrenches on the deputy"
    FRICTION = "joint friction"
    PANELS = "flexible panels"


@dataclass(frozen=True, eq=False)
class FreeBody:
    """A body that floats at time zero: its inertia in its own axes, pose and twist (of its origin)."""

    inertia: Inertia
    body_in_world: Pose
    twist_in_world: Twist


@dataclass(frozen=True)
class Hold:
    """Who holds the deputy from the integration of tick ``tick`` on, '' for nobody."""

    tick: int
    holder: str


@dataclass(frozen=True, eq=False)
class Replay:
    """What moved a robot in a recorded run: its description, where it started, and every effort.

    ``urdf`` describes the robot, with what motors add, ``rotor_inertia`` kg m^2 by joint, which a URDF cannot
    say. ``start_q`` (7 + n,) and ``start_v`` (6 + n,) are as in RobotState; row k of ``efforts`` (N, n) N m
    was held over tick k of ``tick_ns``, joints in the order of ``joint_names``. ``samples`` (K,) are the
    numbers of the states to compare, in rising order; 0 is the start, N the last. ``deputy`` is None without
    mass; it changes hands by ``holds``, in order of time, each time with the impulse that leaves no relative
    twist between hand and body. ``wrenches`` act on the base, each held in ``world`` axes over a tick; what
    they depend on is the state that the engine has. ``effects`` are those that an engine has to know beyond
    efforts and links.
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
    deputy: FreeBody | None = None
    holds: tuple[Hold, ...] = ()
    wrenches: tuple[WrenchModel, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "start_q", "start_v", "efforts")
        self.samples.setflags(write=False)
        object.__setattr__(self, "rotor_inertia", MappingProxyType(dict(self.rotor_inertia)))


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion that an engine computed, a row per sample, by its own kinematics and its own sums.

    ``q`` (K, 7 + n); ``tools`` (K, 7) by arm, position and quaternion x y z w in ``world``; the momenta
    (K, 3) of all bodies together in ``world`` axes, the angular one about the common centre of mass.
    ``deputy`` (K, 7) is its pose, without rows if it has no mass. ``impulses`` (G, 6) N s and N m s has a row
    per grasp: what the hand gives to the deputy, about its origin in ``world`` axes.
    """

    q: Array
    tools: Mapping[str, Array]
    linear_momentum: Array
    angular_momentum: Array
    deputy: Array
    impulses: Array

    def __post_init__(self) -> None:
        freeze(self, "q", "linear_momentum", "angular_momentum", "deputy", "impulses")
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
