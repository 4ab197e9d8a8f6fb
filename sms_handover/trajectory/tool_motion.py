"""Motion of the tools: where they are, their paths, and the joint rates that give their twists."""

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.reduced import carried_twist, drift_of_base, generalized_jacobian
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.pose_path import PosePath
from sms_handover.trajectory.time_law import Progress
from sms_handover.types import BASE_NQ, Array, Pose, Twist, frozen


class ToolMotion(Protocol):
    """What leads the tools of a robot."""

    def tools_at(self, q: Array, arms: Iterable[str] | None = None) -> Mapping[str, Pose]:
        """Return the poses of the tools of some arms in ``world``, by default of all."""

    def placed(self, body_in_world: Pose, frame: pin.SE3, in_frame: pin.SE3) -> Pose:
        """Return the pose in ``world`` of what is fixed to a body, by its pose in a frame of it."""

    def on_path(self, start: Pose, goal: Pose, progress: Progress) -> tuple[Pose, Twist]:
        """Return pose and twist on the way from pose to pose, as :class:`PosePath`."""

    def without_drift(self, q: Array, v: Array, twists: Mapping[str, Twist]) -> Mapping[str, Twist]:
        """Return twists of tools less what they have by the momentum alone, with joints at rest."""

    def resolved(self, q: Array, twists: Mapping[str, Twist], velocity: Array, damping: float) -> Array:
        """Return joint rates (n,): ``velocity``, and for the arms that have a twist those that give it.

        They include the reaction of the base: the damped inverse of the generalised Jacobian [Umetani1989].
        """


class PinocchioToolMotion:
    """Motion of the tools by Pinocchio's kinematics."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def tools_at(self, q: Array, arms: Iterable[str] | None = None) -> Mapping[str, Pose]:
        """Return the poses of the tools of some arms in ``world``, by default of all."""
        return self._robot.tools_at(q, arms)

    def placed(self, body_in_world: Pose, frame: pin.SE3, in_frame: pin.SE3) -> Pose:
        """Return the pose in ``world`` of what is fixed to a body, by its pose in a frame of it."""
        return pose_of(se3_of(body_in_world) * frame * in_frame)

    def on_path(self, start: Pose, goal: Pose, progress: Progress) -> tuple[Pose, Twist]:
        """Return pose and twist on the way from pose to pose, as :class:`PosePath`."""
        return PosePath(start, goal).at(progress)

    def without_drift(self, q: Array, v: Array, twists: Mapping[str, Twist]) -> Mapping[str, Twist]:
        """Return twists of tools less what they have by the momentum alone, with joints at rest."""
        drift, base = drift_of_base(self._robot, q, v), Pose(q[:3], q[3:BASE_NQ])
        tools = self._robot.tools_at(q, twists)
        carried = {arm: carried_twist(base, drift, tools[arm].position) for arm in twists}
        return {
            arm: Twist(twist.linear - carried[arm].linear, twist.angular - carried[arm].angular)
            for arm, twist in twists.items()
        }

    def resolved(self, q: Array, twists: Mapping[str, Twist], velocity: Array, damping: float) -> Array:
        """Return joint rates (n,): ``velocity``, and for the arms that have a twist those that give it."""
        robot = self._robot
        led = [arm for arm in robot.arms if arm in twists]
        jacobian = generalized_jacobian(robot, q, *led)
        wanted = np.concatenate([part for arm in led for part in (twists[arm].linear, twists[arm].angular)])
        columns = np.concatenate([np.arange(robot.n_joints)[robot.arm_joints[arm]] for arm in led])
        free = jacobian[:, columns]
        rest = wanted - jacobian @ velocity  # the other arms move the tool through the base
        damped = free @ free.T + damping**2 * np.eye(rest.size)
        result = np.array(velocity)
        result[columns] = free.T @ np.linalg.solve(damped, rest)
        return frozen(result)
