"""The interface of a control law."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

from sms_handover.types import Array, RobotState, read_only

G = TypeVar("G")


@dataclass(frozen=True, eq=False)
class DesiredMotion:
    """Desired joint position (n,) rad, velocity (n,) rad/s and acceleration (n,) rad/s^2 at one instant."""

    position: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "position", read_only(self.position))
        object.__setattr__(self, "velocity", read_only(self.velocity))
        object.__setattr__(self, "acceleration", read_only(self.acceleration))


@dataclass(frozen=True, eq=False)
class LinearFeedback:
    """A law linearised at rest: u = -(K_e e + K_v e' + K_z z) with z' = e; each (n, n)."""

    position: Array
    velocity: Array
    integral: Array


class ControlLaw(ABC, Generic[G]):
    """A joint-space law with gains of type ``G``: efforts from state and desired motion, e = q - q_d.

    A law keeps no clock and does no I/O. It limits its efforts to what the joints can give.
    """

    @abstractmethod
    def reset(self) -> None:
        """Forget everything since the start of the run."""

    @abstractmethod
    def use(self, gains: G) -> None:
        """Go on with other gains, without a jump that the new gains do not ask for."""

    @abstractmethod
    def step(self, state: RobotState, desired: DesiredMotion, dt: float) -> Array:
        """Return the joint efforts (n,) N m for the tick of ``dt`` s that begins at ``state``."""

    @abstractmethod
    def linearised(self, inertia: Array) -> LinearFeedback:
        """Return the feedback gains of the law at rest, for the reduced inertia H* (n, n)."""
