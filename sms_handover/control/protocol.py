"""Controller protocol: what the loop requires of any controller, ours or a user's."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from sms_handover.errors import ControllerError
from sms_handover.plan_report import PlannedPaths, PlanReport
from sms_handover.previewed_targets import PreviewedTargets, PreviewState
from sms_handover.types import (
    Array,
    GraspEvent,
    JointReference,
    Pose,
    TaskPhase,
    frozen,
)
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Guidance:
    """Output of the trajectory in one reference period, all for the same instant.

    ``reference`` is the desired joint motion, by inverse kinematics with the base locked at its present
    pose; ``tool_in_world`` has the target pose of every tool, where the law declares that it needs them.
    """

    phase: TaskPhase
    reference: JointReference
    tool_in_world: Mapping[str, Pose]

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))


class Controller(Protocol):
    """Computes joint efforts for every state; any object with these three methods is one.

    It keeps no clock and does no I/O, so results are identical in one process and over DDS.
    """

    def reset(self) -> None:
        """Return to the initial state: a run begins."""

    def guide(self, guidance: Guidance) -> None:
        """Use new guidance from now on; called before the effort of the same instant."""

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the joint efforts (n,) N m for the tick that begins at this state.

        ``q`` (7 + n,) is the base's position and quaternion x y z w in ``world``, then the joint angles;
        ``v`` (6 + n,) the base's twist in its own axes, linear then angular, then the joint rates.
        """


@runtime_checkable
class Resumable(Protocol):
    """What a controller has besides, so that a run can be branched: its state as a frozen dataclass.

    The fields of the state are numbers, strings, arrays, and tuples, mappings or dataclasses of such.
    """

    @property
    def state(self) -> Any:
        """Everything that later efforts depend on."""

    def restore(self, state: Any) -> None:
        """Go back to a former :attr:`state`."""


@runtime_checkable
class Planning(Protocol):
    """What a controller has besides that solves a program as it goes on: it tells what came of each solve."""

    def take_status(self) -> PlanReport | None:
        """Return the report of the solve since the last call, None if there was none."""


@runtime_checkable
class Showing(Protocol):
    """What a controller has besides that shows where its plans lead the tools."""

    def take_paths(self) -> PlannedPaths | None:
        """Return the paths that are new since the last call, None if there are none."""


class RemoteSolver(Protocol):
    """What a planning law gets in real time: a process that solves its problems, one after the other."""

    def submit(self, problem: Any) -> None:
        """Send a problem."""

    def take(self) -> Any:
        """Return the next solution, None if there is none yet; never waits."""

    def forget(self) -> None:
        """Drop the solutions of all problems so far."""

    @property
    def trouble(self) -> str:
        """How the process has ended, '' while it runs."""

    def close(self) -> None:
        """End the process."""


@runtime_checkable
class Remote(Planning, Protocol):
    """What a controller has besides whose solver is another process."""

    @property
    def trouble(self) -> str:
        """How that process has ended, '' while it runs."""

    def close(self) -> None:
        """End that process."""


class Preview(Protocol):
    """What a law that declares the need gets: the targets to come, as far as the schedule tells."""

    def reset(self) -> None:
        """Return to the start of a run."""

    def update(
        self,
        phase: TaskPhase,
        reference: JointReference,
        tool_in_world: Mapping[str, Pose],
        q: Array,
        v: Array,
    ) -> None:
        """Take the guidance of now, at a configuration (7 + n,) and a velocity (6 + n,)."""

    def grasped(self, event: GraspEvent) -> None:
        """Learn what came of a grasp command, between two updates."""

    def ahead(self, stamps_ns: Iterable[int]) -> Sequence[PreviewedTargets]:
        """Return the targets at some instants in order, from that of the last update on."""

    @property
    def state(self) -> PreviewState | None:
        """Everything that later previews depend on, None at the start of a run."""

    def restore(self, state: PreviewState | None) -> None:
        """Go back to a former :attr:`state`."""


@dataclass(frozen=True, eq=False)
class NearPair:
    """Two bodies between which distance counts, and what carries them: numbers of Pinocchio's joints.

    The deputy has joint 0, which never moves. ``contact`` is the arm whose gripper the first or the second
    body is where the other is the deputy, '' for any other two; ``one_arm`` tells whether one has both.
    """

    names: tuple[str, str]
    joints: tuple[int, int]
    contact: str
    has_deputy: bool
    one_arm: bool


class Distances(Protocol):
    """What a law that declares the need gets: the signed distances between the bodies of robot and deputy."""

    @property
    def pairs(self) -> Sequence[NearPair]:
        """The pairs of bodies, in the order of their distances."""

    def distances(self, q: Array, deputy_in_world: Pose) -> Array:
        """Return the signed distance (pairs,) m of every pair at a configuration (7 + n,)."""

    def nearest(self, pair: int) -> tuple[Array, Array]:
        """Return where a pair was nearest in the last call: points (2, 3) m, unit normal (3,) in ``world``.

        The normal points from the first body to the second.
        """


@runtime_checkable
class Carrying(Protocol):
    """What a controller has besides that takes account of the mass of the deputy.

    It is declared by :attr:`~sms_handover.control.law.Need.PAYLOAD` of its law, which then is made with the
    deputy as it is known.
    """

    def grasped(self, event: GraspEvent) -> None:
        """Learn what came of a grasp command; the payload is another one from the next state on.

        It may come before the effort for the state of the event or after it, so the change has to wait for a
        state with a later stamp.
        """


class CheckedController:
    """Checks the efforts of a user's controller before they reach the plant."""

    def __init__(self, controller: Controller, joint_names: Sequence[str]) -> None:
        self.inner = controller
        self._joint_names = tuple(joint_names)

    def reset(self) -> None:
        """Reset the controller."""
        self.inner.reset()

    def guide(self, guidance: Guidance) -> None:
        """Guide the controller."""
        self.inner.guide(guidance)

    def grasped(self, event: GraspEvent) -> None:
        """Tell a controller that takes account of the payload."""
        if isinstance(self.inner, Carrying):
            self.inner.grasped(event)

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m, read-only; raises ControllerError unless they are n finite numbers."""
        effort = np.array(self.inner.effort(stamp_ns, q, v), dtype=np.float64)
        if effort.shape != (len(self._joint_names),):
            raise ControllerError(
                f"the controller answered {ns_to_seconds(stamp_ns):g} s with an array of shape "
                f"{effort.shape}, expected one effort in N m for each of {len(self._joint_names)} joints"
            )
        if not np.isfinite(effort).all():
            joint = int(np.flatnonzero(~np.isfinite(effort))[0])
            raise ControllerError(
                f"the controller answered {ns_to_seconds(stamp_ns):g} s with {effort[joint]} N m for "
                f"{self._joint_names[joint]}, expected a finite number"
            )
        return frozen(effort)


def inner_of(controller: Controller) -> Controller:
    """Return the controller itself, without the check of its efforts."""
    return controller.inner if isinstance(controller, CheckedController) else controller
