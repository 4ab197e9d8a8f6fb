"""Twist of the deputy as the trajectory knows it, from where the deputy was a reference period ago."""

import numpy as np
import pinocchio as pin

from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.poses import se3_of
from sms_handover.types import Array, Pose, Twist
from sms_handover.units import ns_to_seconds

Before = tuple[int, Pose]  # stamp in ns, and the pose of the deputy then


class DeputyTwist:
    """Twist of a deputy that moves by itself, by the difference of two poses.

    Between p0, R0 and p1, R1, dt apart: v = (p1 - p0) / dt and omega = R1 log(R0^T R1) / dt, exact for a
    constant twist, and late by dt / 2 for any other. A deputy that has no mass and is at rest at first is
    taken to rest, as it is until an arm has carried it.
    """

    def __init__(self, deputy: DeputyDescription) -> None:
        """Begin with the twist that the deputy is known to start with."""
        at_first = deputy.twist_in_world
        self._at_first = self._latest = at_first
        self.follows = bool(deputy.mass or np.any(at_first.linear) or np.any(at_first.angular))
        self.before: Before | None = None

    def at(self, stamp_ns: int, deputy_in_world: Pose) -> Twist | None:
        """Return the twist of its origin in ``world`` axes, None if it is not followed.

        Asked again at the same stamp it says the same.
        """
        if not self.follows:
            return None
        before = self.before
        if before is not None and before[0] == stamp_ns:
            return self._latest
        self.before, self._latest = (stamp_ns, deputy_in_world), self._at_first
        if before is None or before[0] > stamp_ns:
            return self._latest
        dt = ns_to_seconds(stamp_ns - before[0])
        old, new = se3_of(before[1]), se3_of(deputy_in_world)
        turned = pin.log3(old.rotation.T @ new.rotation)
        self._latest = Twist((new.translation - old.translation) / dt, new.rotation @ (turned / dt))
        return self._latest


def twist_at(twist_in_world: Twist, origin: Array, point: Array) -> Twist:
    """Return the twist of a body at a point (3,) of it, given that of its origin (3,): v + omega x r."""
    lever = np.cross(twist_in_world.angular, point - origin)
    return Twist(twist_in_world.linear + lever, twist_in_world.angular)
