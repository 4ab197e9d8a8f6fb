"""Residual of the tool poses and its Jacobian, with the base locked."""

from collections.abc import Mapping
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, Pose

_ROWS = 6  # residual rows per tool: position, orientation
_BASE_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # position in m, quaternion x y z w


class Residual(NamedTuple):
    """Residual (6 k,) of k tools with its norms.

    ``position_error`` m and ``orientation_error`` rad are the largest over the tools; ``energy`` is half
    the squared norm of all rows, metres and radians weighted alike.
    """

    values: Array
    position_error: float
    orientation_error: float
    energy: float


class PoseResidual:
    """e(q_m) = (p - p_d; log(R_d^T R)) stacked over the tools that have a target.

    The position part is in ``world`` axes, the orientation part in the axes of the tool; its
    Jacobian is J_log3(R_d^T R) times the angular part of the tool's body Jacobian.
    """

    def __init__(self, robot: RobotModel, base_in_world: Pose, tool_in_world: Mapping[str, Pose]) -> None:
        """Fix the base and the targets."""
        self._robot = robot
        self._q = robot.configuration(base_in_world, np.zeros(robot.n_joints))
        self._targets = [
            (_ROWS * index, robot.tool_frame_id[arm], se3_of(pose), pose.position)
            for index, (arm, pose) in enumerate(tool_in_world.items())
        ]
        self._to_rows = np.zeros((_ROWS, _ROWS))  # takes a body twist of the tool to rows of the Jacobian

    def evaluate(self, joint_position: Array) -> Residual:
        """Return the residual."""
        model, data = self._robot.pin, self._robot.data
        self._q[BASE_NQ:] = joint_position
        pin.forwardKinematics(model, data, self._q)
        values = np.empty(_ROWS * len(self._targets))
        distances, angles = [0.0], [0.0]
        for row, frame_id, target, place in self._targets:
            tool = pin.updateFramePlacement(model, data, frame_id)
            way, turn = tool.translation - place, pin.log3(target.actInv(tool).rotation)
            values[row : row + 3] = way
            values[row + 3 : row + _ROWS] = turn
            distances.append(hypot(*way.tolist()))
            angles.append(hypot(*turn.tolist()))
        return Residual(values, max(distances), max(angles), 0.5 * float(values.dot(values)))

    def jacobian(self, joint_position: Array) -> Array:
        """Return the derivative (6 k, n) of the residual with respect to the joint angles."""
        model, data, to_rows = self._robot.pin, self._robot.data, self._to_rows
        self._q[BASE_NQ:] = joint_position
        pin.computeJointJacobians(model, data, self._q)
        jacobian = np.empty((_ROWS * len(self._targets), self._robot.n_joints))
        for row, frame_id, target, _ in self._targets:
            tool = pin.updateFramePlacement(model, data, frame_id)
            to_rows[:3, :3] = tool.rotation
            to_rows[3:, 3:] = pin.Jlog3(target.actInv(tool).rotation)
            body = pin.getFrameJacobian(model, data, frame_id, pin.ReferenceFrame.LOCAL)
            to_rows.dot(body[:, BASE_NV:], out=jacobian[row : row + _ROWS])
        return jacobian


def manipulability(robot: RobotModel, joint_position: Array) -> Array:
    """Return sqrt(det(J J^T)) of every arm with the base locked [Yoshikawa1985], shape (arms,).

    J may have any axes and any point of reference, because twists go from one to another by a matrix of
    determinant 1: it is the Jacobian that Pinocchio has, in the axes and at the origin of the base.
    """
    at_origin = np.concatenate([_BASE_AT_ORIGIN, joint_position])
    jacobian = pin.computeJointJacobians(robot.pin, robot.data, at_origin)[:, BASE_NV:]
    squares = np.empty((len(robot.arms), _ROWS, _ROWS))
    for square, joints in zip(squares, robot.arm_joints.values(), strict=True):
        own = jacobian[:, joints]
        own.dot(own.T, out=square)
    return np.array([sqrt(max(square, 0.0)) for square in np.linalg.det(squares).tolist()])
