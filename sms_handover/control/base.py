"""Base class of the control laws."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

from sms_handover.types import Array

G = TypeVar("G")


@dataclass(frozen=True, eq=False)
class LinearFeedback:
    """A law linearised at rest: u = -(K_e e + K_v e' + K_z z) with z' = e; each (n, n)."""

    position: Array
    velocity: Array
    integral: Array


class ControlLaw(ABC, Generic[G]):
    """A joint-space law with gains of type ``G``: efforts from the state and the desired motion, e = q - q_d.

    A law keeps no clock, does no I/O, and limits its efforts to what the joints can give.
    """

    @abstractmethod
    def reset(self) -> None:
        """Return to the state at the start of a run."""

    @abstractmethod
    def use(self, gains: G) -> None:
        """Switch to other gains without a jump that the new gains do not ask for."""

    @abstractmethod
    def effort(self, q: Array, v: Array, desired: Array, dt: float) -> Array:
        """Return the joint efforts (n,) N m for the tick of ``dt`` s that begins at ``q``, ``v``.

        ``desired`` (3, n) has the rows q_d rad, q_d' rad/s and q_d'' rad/s^2.
        """

    @abstractmethod
    def linearised(self, inertia: Array) -> LinearFeedback:
        """Return the feedback gains of the law at rest, for the reduced inertia H* (n, n)."""
