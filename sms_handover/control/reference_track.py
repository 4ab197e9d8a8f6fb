"""The desired motion between two references, which come less often than ticks."""

import numpy as np

from sms_handover.control.base import DesiredMotion
from sms_handover.types import Array, JointReference
from sms_handover.units import ns_to_seconds


class ReferenceTrack:
    """Carries the last reference forward: q_d + q_d' s + q_d'' s^2 / 2 after s seconds.

    The acceleration is the difference quotient of the last two reference velocities, so it is zero
    for targets that stand still and lags by one reference period for those that move.
    """

    def __init__(self) -> None:
        """Start without a reference."""
        self.reset()

    @property
    def ready(self) -> bool:
        """Tell whether a reference has come."""
        return self._last is not None

    def reset(self) -> None:
        """Forget every reference."""
        self._last: JointReference | None = None
        self._acceleration: Array = np.zeros(0)
        self._broken = False

    def restart(self) -> None:
        """Take no difference across this instant, as at a new phase where the desired velocity jumps."""
        self._broken = True

    def update(self, reference: JointReference) -> None:
        """Take the next reference."""
        previous = self._last
        self._acceleration = np.zeros_like(reference.velocity)
        if previous is not None and not self._broken:
            period = ns_to_seconds(reference.stamp_ns - previous.stamp_ns)
            self._acceleration = (reference.velocity - previous.velocity) / period
        self._last = reference
        self._broken = False

    def at(self, stamp_ns: int) -> DesiredMotion:
        """Return the desired motion at a time not before the last reference."""
        reference = self._last
        if reference is None:
            raise RuntimeError("no reference has come yet")
        s = ns_to_seconds(stamp_ns - reference.stamp_ns)
        velocity = reference.velocity + self._acceleration * s
        position = reference.position + reference.velocity * s + self._acceleration * (0.5 * s * s)
        return DesiredMotion(position, velocity, self._acceleration)
