"""Distance gradients: how signed distances of bodies change with the velocity, and how small they may be.

A signed distance d between nearest points p_1, p_2 with normal n from the first body to the second changes by
n^T (dp_2 - dp_1), whatever the points do on the surfaces.
"""

import numpy as np
import pinocchio as pin

from sms_handover.control.protocol import Distances, NearPair
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array, Pose

_LEAST = 0.001  # [m] that links of one arm keep, and a gripper from the deputy that it may touch
_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class DistanceGradients:
    """Distances between the bodies of robot and deputy, with gradients; owns work space of Pinocchio."""

    def __init__(self, robot: RobotModel, distances: Distances, least: float) -> None:
        """Use the kinematics of a robot; no two bodies are to be nearer than ``least`` m."""
        self._robot, self._data = robot, robot.pin.createData()
        self._distances, self._least = distances, least
        self.pairs = distances.pairs

    def at(self, q: Array, target: PreviewedTargets) -> Array:
        """Return the distance (pairs,) m of every pair at a configuration (7 + n,)."""
        pin.computeJointJacobians(self._robot.pin, self._data, q)
        return self._distances.distances(q, self._deputy_in_world(target))

    def least(self, target: PreviewedTargets) -> Array:
        """Return what the distance of every pair is not to be below, m: any for what is carried as one body.

        A gripper that may touch the deputy is only not to enter it.
        """
        return np.array([self._least_of(pair, target) for pair in self.pairs])

    def gradient(self, index: int, target: PreviewedTargets) -> Array:
        """Return the derivative (1, 6 + n) by v of the distance of a pair, where :meth:`at` was last."""
        pair = self.pairs[index]
        points, normal = self._distances.nearest(index)
        first, second = (self._moved(pair, side, points[side], target) for side in (0, 1))
        return np.asarray(normal @ (second - first))[np.newaxis]

    def _deputy_in_world(self, target: PreviewedTargets) -> Pose:
        """Return the pose of the deputy where joints have been placed."""
        if not target.holder:
            return target.deputy
        frame = self._robot.tool_frame_id[target.holder]
        tool = pin.updateFramePlacement(self._robot.pin, self._data, frame)
        return pose_of(tool * se3_of(target.deputy))

    def _least_of(self, pair: NearPair, target: PreviewedTargets) -> float:
        """Return what the distance of a pair is not to be below, m."""
        if pair.has_deputy and target.holder:
            carrier = self._robot.pin.frames[self._robot.tool_frame_id[target.holder]].parentJoint
            if carrier in pair.joints:
                return -np.inf
        touches = pair.one_arm or pair.contact in target.touching
        return _LEAST if touches else self._least

    def _moved(self, pair: NearPair, side: int, point: Array, target: PreviewedTargets) -> Array:
        """Return the Jacobian (3, 6 + n) of a point of a body in ``world`` axes."""
        robot, joint = self._robot, pair.joints[side]
        if joint == 0 and target.holder:
            joint = robot.pin.frames[robot.tool_frame_id[target.holder]].parentJoint
        if joint == 0:
            return np.zeros((3, robot.pin.nv))
        jacobian = pin.getJointJacobian(robot.pin, self._data, joint, _ALIGNED)
        arm = point - self._data.oMi[joint].translation
        return np.asarray(jacobian[:3] - pin.skew(arm) @ jacobian[3:])
