"""Sensor protocol: what is true at a tick, what is known of it, and what a sensor keeps from tick to tick."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, Pose, freeze, read_only
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True, eq=False)
class Truth:
    """Robot and deputy as they are at a tick: q (7 + n,) and v (6 + n,), and what asks for the deputy."""

    tick: int
    q: Array
    v: Array
    deputy_in_world: Callable[[], Pose]


@dataclass(eq=False)
class Known:
    """What is known at the same tick: the truth at first, in whose place each sensor puts what it tells.

    ``deputy_in_world`` stays None unless a sensor sees the deputy; ``turned`` (3,) rad is how far a gyro has
    measured the base to turn since its reading before, None in a tick without a reading.
    """

    q: Array
    v: Array
    deputy_in_world: Pose | None = None
    turned: Array | None = None


@dataclass(frozen=True, eq=False)
class Reading:
    """What a sensor gives at a tick: numbers, measured at ``tick``, with the variance of each that has one.

    The numbers of an angular velocity are (3,) rad/s, those of a pose (7,) with six variances in m^2 and
    rad^2.
    """

    sensor: str
    tick: int
    values: Array
    variance: Array

    def __post_init__(self) -> None:
        freeze(self, "values", "variance")


@dataclass(frozen=True, eq=False)
class Sample:
    """Numbers that were measured at a tick."""

    tick: int
    values: Array

    def __post_init__(self) -> None:
        freeze(self, "values")


@dataclass(frozen=True, eq=False)
class Memory:
    """What a sensor keeps: numbers of its filter, samples on their way, and the latest that has come."""

    held: Array
    waiting: tuple[Sample, ...] = ()
    latest: Sample | None = None

    def __post_init__(self) -> None:
        freeze(self, "held")


EMPTY = Memory(read_only(np.empty(0)))


@dataclass(frozen=True)
class Setting:
    """What sensors are made for: joints, the tick in ns and the random streams of a run."""

    joints: int
    tick_ns: int
    streams: RandomStreams

    @property
    def tick_s(self) -> float:
        """The tick in s."""
        return ns_to_seconds(self.tick_ns)


class Sensor(Protocol):
    """Measures every tick in turn; what its results depend on besides seed and truth is its memory."""

    memory: Memory

    @property
    def applied(self) -> Mapping[str, Any]:
        """The values by which it computes, by the names that files of conditions have, times in s."""

    def reset(self) -> None:
        """Go back to the start of a run."""

    def measure(self, truth: Truth, known: Known) -> Reading | None:
        """Change what is known at a tick, and return what the sensor gives in it, if it does."""


class SensorValues(Protocol):
    """The values of one kind of sensor."""

    def check(self, tick_ns: int) -> None:
        """Raise ConfigurationError unless every time is a multiple of the tick."""

    def make(self, setting: Setting) -> Sensor:
        """Return the sensor of a run."""


def in_ticks(seconds: float, tick_ns: int, path: str) -> int:
    """Return a time in ticks; raises ConfigurationError if that is no whole number."""
    ticks, rest = divmod(seconds_to_ns(seconds), tick_ns)
    if rest:
        raise ConfigurationError(
            f"conditions.sensors.{path} is {seconds:g} s, must be a multiple of the tick of "
            f"{ns_to_seconds(tick_ns):g} s"
        )
    return ticks
