"""Distance rows: the nearest pairs of bodies at each instant of a prediction, linearised.

A signed distance d between nearest points p_1, p_2 with normal n from the first body to the second changes by
n^T (dp_2 - dp_1), whatever the points do on the surfaces.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.control.mpc.placement import Placement
from sms_handover.control.mpc.prediction import Derivatives
from sms_handover.control.protocol import Distances, NearPair
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose, PreviewedTargets

_LEAST = 0.001  # [m] that links of one arm keep, and a gripper from the deputy that it may touch
_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class DistanceRows:
    """Signed distances (K, r) m of the r nearest pairs at K instants, by name, and their derivatives.

    ``at_start`` (K, r) m are the distances of the same pairs where the prediction begins, ``least`` (K, r) m
    what they are not to be below.
    """

    distance: Array
    at_start: Array
    least: Array
    names: tuple[tuple[str, ...], ...]
    by: Derivatives


class DistanceModel:
    """Finds the nearest pairs of a robot and the deputy; owns work space of Pinocchio."""

    def __init__(self, robot: RobotModel, distances: Distances, most: int, least: float) -> None:
        """Find up to ``most`` pairs at each instant, of which none is to be nearer than ``least`` m."""
        self._robot, self._data = robot, robot.pin.createData()
        self._distances, self._pairs = distances, distances.pairs
        self._most, self._least = min(most, len(self._pairs)), least

    def at(self, placed: Sequence[Placement], targets: Sequence[PreviewedTargets]) -> DistanceRows:
        """Return the rows at all placements but the first, which only tells what distances are at the start.

        A gripper that may touch the deputy is only not to enter it, and the hand that holds it has no row.
        """
        start, placed = placed[0], placed[1:]
        pin.computeJointJacobians(self._robot.pin, self._data, start.q)
        beginning = self._distances.distances(start.q, self._deputy_in_world(targets[0]))
        count, most, n = len(placed), self._most, self._robot.n_joints
        distance, at_start, least = (np.zeros((count, most)) for _ in range(3))
        names = list[tuple[str, ...]]()
        by_q, by_phi = np.zeros((count, most, n)), np.zeros((count, most, 3))
        for k, (place, target) in enumerate(zip(placed, targets, strict=True)):
            pin.computeJointJacobians(self._robot.pin, self._data, place.q)
            found = self._distances.distances(place.q, self._deputy_in_world(target))
            limits = np.array([self._least_of(pair, target) for pair in self._pairs])
            nearest = np.argsort(found - limits, kind="stable")[:most]
            for row, index in enumerate(nearest.tolist()):
                pair = self._pairs[index]
                distance[k, row], at_start[k, row] = found[index], beginning[index]
                least[k, row] = limits[index]
                by_q[k, row], by_phi[k, row] = place.reduced(self._gradient(pair, index, target))
            names.append(tuple(" - ".join(self._pairs[index].names) for index in nearest.tolist()))
        return DistanceRows(
            distance, at_start, least, tuple(names), Derivatives(by_q, np.zeros_like(by_q), by_phi)
        )

    def _deputy_in_world(self, target: PreviewedTargets) -> Pose:
        """Return the pose of the deputy where joints have been placed."""
        if not target.holder:
            return target.deputy
        frame = self._robot.tool_frame_id[target.holder]
        tool = pin.updateFramePlacement(self._robot.pin, self._data, frame)
        return pose_of(tool * se3_of(target.deputy))

    def _least_of(self, pair: NearPair, target: PreviewedTargets) -> float:
        """Return what the distance of a pair is not to be below, m: any for what is carried as one body."""
        if pair.has_deputy and target.holder:
            carrier = self._robot.pin.frames[self._robot.tool_frame_id[target.holder]].parentJoint
            if carrier in pair.joints:
                return -np.inf
        touches = pair.one_arm or pair.contact in target.touching
        return _LEAST if touches else self._least

    def _gradient(self, pair: NearPair, index: int, target: PreviewedTargets) -> Array:
        """Return the derivative (1, 6 + n) of the distance of a pair by v."""
        points, normal = self._distances.nearest(index)
        first, second = (self._moved(pair, side, points[side], target) for side in (0, 1))
        return np.asarray(normal @ (second - first))[np.newaxis]

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
