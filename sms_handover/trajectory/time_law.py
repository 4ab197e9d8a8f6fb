"""Time laws: progress of a motion and its rate as a function of time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Progress:
    """Fraction of a motion done, from 0 to 1, and its rate in 1/s."""

    fraction: float
    rate: float


def step(elapsed: float, duration: float) -> Progress:
    """Return a motion that is done at once."""
    return Progress(1.0, 0.0)


def quintic(elapsed: float, duration: float) -> Progress:
    """Return the rest-to-rest quintic 10 x^3 - 15 x^4 + 6 x^5 with x = elapsed / duration.

    Velocity and acceleration are zero at both ends; outside the motion it stands still.
    """
    x = min(max(elapsed / duration, 0.0), 1.0)
    fraction = x**3 * (10.0 + x * (-15.0 + 6.0 * x))
    return Progress(fraction, 30.0 * x**2 * (1.0 - x) ** 2 / duration)


TimeLaw = Callable[[float, float], Progress]

TIME_LAWS: Mapping[str, TimeLaw] = MappingProxyType({"step": step, "quintic": quintic})
