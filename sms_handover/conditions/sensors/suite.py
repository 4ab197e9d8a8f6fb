"""Suite of the sensors of a run: what is measured in every tick."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.conditions.sensors.sensor import (
    Known,
    Memory,
    Reading,
    Sensor,
    SensorValues,
    Setting,
    Truth,
)
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, Pose, freeze


@dataclass(frozen=True, eq=False)
class Measured:
    """What is known at a tick: q (7 + n,), v (6 + n,), and the deputy, None unless it is seen.

    What no sensor measures is the truth. ``readings`` is what sensors have given in the tick.
    """

    q: Array
    v: Array
    deputy_in_world: Pose | None = None
    readings: tuple[Reading, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "q", "v")


@dataclass(frozen=True, eq=False)
class SensorsState:
    """What later measurements depend on besides seed and truth: a memory by sensor, and those of now."""

    memories: Mapping[str, Memory] = field(default_factory=dict)
    q: Array = field(default_factory=lambda: np.empty(0))
    v: Array = field(default_factory=lambda: np.empty(0))
    deputy_in_world: Pose | None = None

    def __post_init__(self) -> None:
        freeze(self, "q", "v")
        object.__setattr__(self, "memories", MappingProxyType(dict(self.memories)))


class SensorSuite:
    """The sensors of a run, which measure one after the other in the order of the registry.

    Each has a stream of its own, and takes the numbers of a tick by its number.
    """

    def __init__(self, sensors: Mapping[str, SensorValues], joints: int, tick_ns: int, seed: int) -> None:
        """Make the sensors; raises ConfigurationError on a time that is no multiple of the tick."""
        self._values, self._joints, self._tick_ns = sensors, joints, tick_ns
        self.seed(seed)

    def seed(self, seed: int) -> None:
        """Let every random stream follow from a seed, from the start of a run on."""
        setting = Setting(self._joints, self._tick_ns, RandomStreams(seed))
        self._sensors: dict[str, Sensor] = {
            name: values.make(setting) for name, values in self._values.items()
        }

    @property
    def applied(self) -> dict[str, Mapping[str, Any]]:
        """The values by which each sensor computes, by its name."""
        return {name: sensor.applied for name, sensor in self._sensors.items()}

    def reset(self) -> None:
        """Go back to the start of a run."""
        for sensor in self._sensors.values():
            sensor.reset()

    def measure(self, truth: Truth) -> Measured:
        """Return what is known at a tick; to be asked once for every tick in turn."""
        known = Known(np.array(truth.q), np.array(truth.v))
        readings = [sensor.measure(truth, known) for sensor in self._sensors.values()]
        given = tuple(reading for reading in readings if reading)
        return Measured(known.q, known.v, known.deputy_in_world, given)

    def state(self, now: Measured) -> SensorsState:
        """Return the state to :meth:`restore`, with what is known now."""
        memories = {name: sensor.memory for name, sensor in self._sensors.items()}
        return SensorsState(memories, now.q, now.v, now.deputy_in_world)

    def restore(self, state: SensorsState) -> Measured:
        """Go back to a former state, and return what was known then; raises ConfigurationError."""
        if set(state.memories) != set(self._sensors):
            own, others = (", ".join(sorted(names)) or "none" for names in (self._sensors, state.memories))
            raise ConfigurationError(f"the snapshot has the sensors {others}, must have {own}")
        for name, memory in state.memories.items():
            self._sensors[name].memory = memory
        return Measured(state.q, state.v, state.deputy_in_world)
