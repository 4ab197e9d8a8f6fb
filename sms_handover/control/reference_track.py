"""Reference track: the desired motion between two joint references."""

from dataclasses import dataclass

import numpy as np

from sms_handover.types import Array, JointReference, frozen, read_only
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class TrackState:
    """The last reference, the desired acceleration (n,) rad/s^2, and whether the next one is zero."""

    reference: JointReference | None
    acceleration: Array
    broken: bool


class ReferenceTrack:
    """Extrapolates the last reference: q_d + q_d' s + q_d'' s^2 / 2 after s seconds.

    The acceleration is the difference quotient of the last two reference velocities, so it is zero
    for targets at rest and lags by one reference period otherwise. Beyond an age of ``longest_ns`` the
    desired joints stop where they are by then.
    """

    def __init__(self, longest_ns: int | None = None) -> None:
        self._longest_ns = longest_ns
        self.reset()

    def reset(self) -> None:
        """Discard every reference."""
        self._last: JointReference | None = None
        self._set(np.zeros((3, 0)))
        self._broken = False

    @property
    def longest_ns(self) -> int | None:
        """The age in ns up to which a reference is extrapolated, None without a bound."""
        return self._longest_ns

    @property
    def motion(self) -> Array:
        """The rows q_d, q_d', q_d'' (3, n) at the last reference, read-only."""
        return self._motion

    @property
    def stamp_ns(self) -> int:
        """The time of the last reference; raises RuntimeError if none has come."""
        return self._latest.stamp_ns

    @property
    def ready(self) -> bool:
        """Whether there is a reference."""
        return self._last is not None

    @property
    def state(self) -> TrackState:
        """Everything that the desired motion depends on."""
        return TrackState(self._last, read_only(self._motion[2]), self._broken)

    def restore(self, state: TrackState) -> None:
        """Go back to a former :attr:`state`."""
        self.reset()
        if state.reference:
            reference = state.reference
            self._set(np.array([reference.position, reference.velocity, state.acceleration]))
        self._last, self._broken = state.reference, state.broken

    def restart(self) -> None:
        """Take no velocity difference across this instant: at a new phase the desired velocity jumps."""
        self._broken = True

    def update(self, reference: JointReference) -> None:
        """Track the next reference."""
        previous = self._last
        motion = np.zeros((3, reference.position.size))
        motion[0], motion[1] = reference.position, reference.velocity
        if previous is not None and not self._broken:
            period = ns_to_seconds(reference.stamp_ns - previous.stamp_ns)
            motion[2] = (reference.velocity - previous.velocity) / period
        self._set(motion)
        self._last = reference
        self._broken = False

    def at(self, stamp_ns: int) -> Array:
        """Return q_d, q_d' and q_d'', the rows of (3, n), at a time not before the last reference."""
        age_ns, longest_ns = stamp_ns - self._latest.stamp_ns, self._longest_ns
        if longest_ns is not None and age_ns > longest_ns:
            stand = np.zeros_like(self._motion)
            stand[0] = self._carried(longest_ns)[0]
            return stand
        return self._carried(age_ns)

    @property
    def _latest(self) -> JointReference:
        if self._last is None:
            raise RuntimeError("no reference has come yet")
        return self._last

    def _set(self, motion: Array) -> None:
        """Take over the rows q_d, q_d', q_d'' (3, n) at the last reference, and keep their derivatives."""
        self._motion = frozen(motion)
        self._first, self._second = np.zeros_like(motion), np.zeros_like(motion)
        self._first[:2], self._second[:1] = motion[1:], motion[2:]
        self._still = not np.any(motion[1:])

    def _carried(self, age_ns: int) -> Array:
        """Return the rows of the desired motion at an age of the last reference, summed in this order."""
        if self._still:
            return self._motion
        s = ns_to_seconds(age_ns)
        motion: Array = self._motion + s * self._first + 0.5 * s * s * self._second
        return motion
