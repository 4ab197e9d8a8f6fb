"""Kinematics of the plant: where tools and a held deputy are, and what is conserved."""

from typing import Protocol

from sms_handover.model.conserved import ConservedQuantities, conserved_quantities
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.types import Array, Pose, Twist


class PlantKinematics(Protocol):
    """What is worked out of a configuration q (7 + n,) and a velocity v (6 + n,)."""

    def tools_at(self, q: Array) -> dict[str, Pose]:
        """Return the pose of every tool in ``world``."""

    def tool_motion(self, q: Array, v: Array, arm: str) -> tuple[Pose, Twist]:
        """Return pose and twist of a tool: of its origin, in the axes of ``world``."""

    def conserved(self, q: Array, v: Array) -> ConservedQuantities:
        """Return momenta, energy and centre of mass of the robot."""

    def carry(self, deputy: MasslessDeputy, q: Array, v: Array) -> None:
        """Move a held deputy with its tool."""


class PinocchioKinematics:
    """Kinematics by Pinocchio's algorithms."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def tools_at(self, q: Array) -> dict[str, Pose]:
        """Return the pose of every tool in ``world``."""
        return self._robot.tools_at(q)

    def tool_motion(self, q: Array, v: Array, arm: str) -> tuple[Pose, Twist]:
        """Return pose and twist of a tool: of its origin, in the axes of ``world``."""
        return self._robot.tool_motion(q, v, arm)

    def conserved(self, q: Array, v: Array) -> ConservedQuantities:
        """Return momenta, energy and centre of mass of the robot."""
        return conserved_quantities(self._robot, q, v)

    def carry(self, deputy: MasslessDeputy, q: Array, v: Array) -> None:
        """Move a held deputy with its tool."""
        deputy.follow(*self._robot.tool_motion(q, v, deputy.holder))
