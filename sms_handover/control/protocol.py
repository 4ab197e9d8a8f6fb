"""What the loop asks of a controller, so that one from outside the package can take the place of ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np

from sms_handover.errors import ControllerError
from sms_handover.types import Array, JointReference, Pose, TaskPhase, frozen
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Guidance:
    """What the trajectory gives each reference period, all for the same instant.

    ``reference`` is the desired joint motion, found by inverse kinematics with the base locked where it
    is; ``tool_in_world`` has the target pose of every arm's tool. A law may follow either.
    """

    phase: TaskPhase
    reference: JointReference
    tool_in_world: Mapping[str, Pose]

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))


class Controller(Protocol):
    """Answers every state with joint efforts; whatever has these three methods is one.

    It keeps no clock and does no I/O, so that it gives the same numbers in one process and over DDS.
    """

    def reset(self) -> None:
        """Forget everything: a run begins."""

    def guide(self, guidance: Guidance) -> None:
        """Take what holds from now on; called before the effort of each instant that has new guidance."""

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the joint efforts (n,) N m for the tick that begins at this state.

        ``q`` (7 + n,) is the base's position and quaternion x y z w in ``world``, then the joint angles;
        ``v`` (6 + n,) the base's twist in its own axes, linear then angular, then the joint rates.
        """


class CheckedController:
    """A controller from outside whose efforts are checked before they reach the plant."""

    def __init__(self, controller: Controller, joint_names: Sequence[str]) -> None:
        """Check a controller of these joints."""
        self._controller = controller
        self._joint_names = tuple(joint_names)

    def reset(self) -> None:
        """Pass it on."""
        self._controller.reset()

    def guide(self, guidance: Guidance) -> None:
        """Pass it on."""
        self._controller.guide(guidance)

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m, read-only; raises ControllerError unless they are n finite numbers."""
        effort = np.array(self._controller.effort(stamp_ns, q, v), dtype=np.float64)
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
