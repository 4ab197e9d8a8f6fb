"""Pose path: a straight line for the origin, the shortest rotation for the axes."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import pose_of, se3_of
from sms_handover.trajectory.time_law import Progress
from sms_handover.types import Pose, Twist

_AT_REST = Twist(np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PosePath:
    """The geodesic of R^3 x SO(3): p = p0 + s (p1 - p0), R = R0 exp(s log(R0^T R1))."""

    start: Pose
    end: Pose

    def at(self, progress: Progress) -> tuple[Pose, Twist]:
        """Return pose and twist (of the origin, in ``world`` axes) at a point of the time law."""
        if progress.fraction == 1.0 and progress.rate == 0.0:
            return self.end, _AT_REST
        start, end = se3_of(self.start), se3_of(self.end)
        turn = pin.log3(start.rotation.T.dot(end.rotation))
        rotation = start.rotation.dot(pin.exp3(progress.fraction * turn))
        way = end.translation - start.translation
        pose = pose_of(pin.SE3(rotation, start.translation + progress.fraction * way))
        return pose, Twist(progress.rate * way, start.rotation.dot(progress.rate * turn))
