"""Control law: what the registry knows of a law, and the interface of laws that follow joint references."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

import numpy as np

from sms_handover.control.computed_torque import ComputedTorque, TrackingEfforts
from sms_handover.control.protocol import Controller, Distances, Preview, RemoteSolver
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array

G = TypeVar("G")


class Need(Enum):
    """What a law uses beyond states, phases and joint references; the value is what a user reads."""

    TOOL_TARGETS = "tool targets"
    PREVIEW = "preview"
    PAYLOAD = "payload"
    CLEARANCE = "clearance"


@dataclass(frozen=True, eq=False)
class LinearFeedback:
    """A law linearised at rest: u = -(K_e e + K_v e' + K_z z) with z' = e; each (n, n)."""

    position: Array
    velocity: Array
    integral: Array


@dataclass(frozen=True, eq=False)
class LawSetup(Generic[G]):
    """What a controller is made from; ``gains`` has one set per phase of the schedule, by phase index.

    A joint reference is extrapolated up to an age of ``longest_reference_ns``, without bound if None.
    ``computed_torque`` makes the inverse dynamics of a robot, by Pinocchio or compiled. ``deputy`` is the one
    that is handed over, as the law knows it. Guidance comes every ``reference_ns``. What a law needs besides
    it gets if it declares so: a ``preview`` of targets to come, the ``distances`` between bodies. In real
    time ``start_solver`` starts a process that solves the problems of a planning law.
    ``compiled_derivatives`` makes those of the dynamics as C code, for a law whose parameters ask for it.
    """

    robot: RobotModel
    gains: tuple[G, ...]
    tick_ns: int
    longest_reference_ns: int | None = None
    computed_torque: Callable[[RobotModel], TrackingEfforts] = ComputedTorque
    deputy: DeputyDescription | None = None
    reference_ns: int = 20_000_000
    preview: Preview | None = None
    distances: Distances | None = None
    compiled_derivatives: Callable[[RobotModel], Any] | None = None
    start_solver: Callable[["LawSetup[Any]"], RemoteSolver] | None = None


@dataclass(frozen=True, eq=False)
class Law(Generic[G]):
    """An entry of the registry of control laws.

    ``parameters`` is a frozen dataclass whose fields are made by
    :func:`sms_handover.configuration.parameters.parameter`. ``linearised`` gives the feedback at rest for a
    set of gains and the reduced inertia H* (n, n); without it the sampled loop is not checked.
    """

    name: str
    description: str
    parameters: type[G]
    make: Callable[[LawSetup[G]], Controller]
    linearised: Callable[[G, Array], LinearFeedback] | None = None
    needs: frozenset[Need] = frozenset()


class JointLaw(ABC, Generic[G]):
    """A joint-space law with gains of type ``G``: efforts from the state and the desired motion, e = q - q_d.

    A law keeps no clock, does no I/O, and limits its efforts to what the joints can give.
    """

    @abstractmethod
    def use(self, gains: G) -> None:
        """Switch to other gains without a jump that the new gains do not ask for."""

    @abstractmethod
    def effort(self, q: Array, v: Array, desired: Array, dt: float) -> Array:
        """Return the joint efforts (n,) N m for the tick of ``dt`` s that begins at ``q``, ``v``.

        ``desired`` (3, n) has the rows q_d rad, q_d' rad/s and q_d'' rad/s^2.
        """

    def carry(self, robot: RobotModel) -> None:
        """Go on with the dynamics of a robot with another payload; a law without a model ignores it."""

    @property
    def memory(self) -> Array:
        """What the law remembers besides its gains, as one array that is empty for a law without state."""
        return np.zeros(0)

    def restore(self, memory: Array) -> None:
        """Go back to a former :attr:`memory`; an empty one is that of the start of a run."""
