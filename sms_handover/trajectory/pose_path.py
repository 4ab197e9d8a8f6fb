"""Pose path: a straight line for the origin, the shortest rotation for the axes, to a goal that may move."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import pose_of, se3_of
from sms_handover.trajectory.time_law import Progress
from sms_handover.types import Array, Pose, Twist

AT_REST = Twist(np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PosePath:
    """The geodesic of R^3 x SO(3): p = p0 + s (p1 - p0), R = R0 exp(s log(R0^T R1)).

    The end may move with ``end_twist``, of its origin in ``world`` axes. With phi = log(R0^T R1) and the
    right Jacobian J_r of the exponential map [Sola2018], the twist then is

        v = s' (p1 - p0) + s v1,    omega = R (s' phi + s J_r(s phi) J_r(phi)^-1 R1^T omega1).
    """

    start: Pose
    end: Pose
    end_twist: Twist = AT_REST

    def at(self, progress: Progress) -> tuple[Pose, Twist]:
        """Return pose and twist (of the origin, in ``world`` axes) at a point of the time law."""
        if progress.fraction == 1.0 and progress.rate == 0.0:
            return self.end, self.end_twist
        start, end = se3_of(self.start), se3_of(self.end)
        turn = pin.log3(start.rotation.T.dot(end.rotation))
        rotation = start.rotation.dot(pin.exp3(progress.fraction * turn))
        way = end.translation - start.translation
        pose = pose_of(pin.SE3(rotation, start.translation + progress.fraction * way))
        twist = Twist(progress.rate * way, start.rotation.dot(progress.rate * turn))
        return pose, twist if self.end_twist is AT_REST else self._with_the_end(
            progress, rotation, turn, twist
        )

    def _with_the_end(self, progress: Progress, rotation: Array, turn: Array, twist: Twist) -> Twist:
        """Return the twist of the path with what the motion of its end adds."""
        s, end_rotation = progress.fraction, se3_of(self.end).rotation
        change = pin.Jlog3(pin.exp3(turn)) @ (end_rotation.T @ self.end_twist.angular)
        angular = rotation @ (s * (pin.Jexp3(s * turn) @ change))
        return Twist(twist.linear + s * self.end_twist.linear, twist.angular + angular)
