"""Damped stepper: steps of a robot with springs and dampers, and what the dampers take in them."""

from sms_handover.model.springs import Springs
from sms_handover.plant.stepper import Stepper
from sms_handover.types import Array


class DampedStepper:
    """Steps of ``h`` s by another stepper; of the latest it knows what dampers took. Not thread-safe."""

    def __init__(self, inner: Stepper, springs: Springs, h: float) -> None:
        self._inner, self._springs, self._h = inner, springs, h
        self.taken = 0.0  # J

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        end = self._inner.step(q, v, effort)
        self.taken = self._springs.taken((q, v), end, self._h)
        return end
