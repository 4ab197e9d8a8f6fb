"""Pose residual of the tools and its Jacobian, with the base locked."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array, Pose

_ROWS = 6  # residual rows per tool: position, orientation


@dataclass(frozen=True, eq=False)
class Residual:
    """Residual (6 k,) of k tools and its Jacobian (6 k, n) with respect to the joint angles."""

    values: Array
    jacobian: Array

    @property
    def position_error(self) -> float:
        """Largest distance in m of a tool to its target."""
        return max(float(np.linalg.norm(row[:3])) for row in self.values.reshape(-1, _ROWS))

    @property
    def orientation_error(self) -> float:
        """Largest angle in rad of a tool to its target."""
        return max(float(np.linalg.norm(row[3:])) for row in self.values.reshape(-1, _ROWS))

    @property
    def energy(self) -> float:
        """Half the squared norm of the residual, metres and radians weighted alike."""
        return 0.5 * float(self.values @ self.values)


class PoseResidual:
    """e(q_m) = (p - p_d; log(R_d^T R)) stacked over the tools that have a target.

    The position part is in ``world`` axes, the orientation part in the axes of the tool; its
    Jacobian is J_log3(R_d^T R) times the angular part of the tool's body Jacobian.
    """

    def __init__(self, robot: RobotModel, base_in_world: Pose, tool_in_world: Mapping[str, Pose]) -> None:
        """Fix the base and the targets."""
        self._robot = robot
        self._base = base_in_world
        self._targets = [(robot.tool_frame_id[arm], se3_of(pose)) for arm, pose in tool_in_world.items()]

    def values(self, joint_position: Array) -> Array:
        """Return the residual (6 k,) alone."""
        robot = self._robot
        pin.forwardKinematics(robot.pin, robot.data, robot.configuration(self._base, joint_position))
        rows = []
        for frame_id, target in self._targets:
            tool = pin.updateFramePlacement(robot.pin, robot.data, frame_id)
            rows.append(tool.translation - target.translation)
            rows.append(pin.log3(target.rotation.T @ tool.rotation))
        return np.concatenate(rows)

    def evaluate(self, joint_position: Array) -> Residual:
        """Return residual and Jacobian."""
        robot = self._robot
        q = robot.configuration(self._base, joint_position)
        pin.computeJointJacobians(robot.pin, robot.data, q)
        values = np.empty(_ROWS * len(self._targets))
        jacobian = np.empty((_ROWS * len(self._targets), robot.n_joints))
        for index, (frame_id, target) in enumerate(self._targets):
            tool = pin.updateFramePlacement(robot.pin, robot.data, frame_id)
            turn = target.rotation.T @ tool.rotation
            frame = pin.ReferenceFrame.LOCAL
            body = pin.getFrameJacobian(robot.pin, robot.data, frame_id, frame)[:, BASE_NV:]
            row = _ROWS * index
            values[row : row + 3] = tool.translation - target.translation
            values[row + 3 : row + 6] = pin.log3(turn)
            jacobian[row : row + 3] = tool.rotation @ body[:3]
            jacobian[row + 3 : row + 6] = pin.Jlog3(turn) @ body[3:]
        return Residual(values, jacobian)


def manipulability(robot: RobotModel, base_in_world: Pose, joint_position: Array) -> Array:
    """Return sqrt(det(J J^T)) of every arm with the base locked [Yoshikawa1985], shape (arms,)."""
    q = robot.configuration(base_in_world, joint_position)
    pin.computeJointJacobians(robot.pin, robot.data, q)
    measures = []
    for arm in robot.arms:
        columns = robot.arm_joints[arm]
        part = slice(BASE_NV + columns.start, BASE_NV + columns.stop)
        frame = pin.ReferenceFrame.LOCAL
        body = pin.getFrameJacobian(robot.pin, robot.data, robot.tool_frame_id[arm], frame)[:, part]
        measures.append(np.sqrt(max(np.linalg.det(body @ body.T), 0.0)))
    return np.array(measures)
