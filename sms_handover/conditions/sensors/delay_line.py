"""Delay line: samples of a sensor that measures now and then, and gives them later."""

from sms_handover.conditions.sensors.sensor import Memory, Sample, in_ticks
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds


class DelayLine:
    """Measures every so many ticks; a sample comes ``latency`` ticks after it was measured.

    A run begins as if the sensor had been at work before: the sample of its first tick is there at once, as
    the latest one, and comes as every other too.
    """

    def __init__(self, sensor: str, period: float, latency: float, tick_ns: int) -> None:
        """Take period and latency in s; raises ConfigurationError unless they are multiples of the tick."""
        self._every, self._tick_ns = in_ticks(period, tick_ns, f"{sensor}.period"), tick_ns
        self._latency = in_ticks(latency, tick_ns, f"{sensor}.latency")

    @property
    def applied(self) -> dict[str, float]:
        """Period and latency by which it counts, in s; 0 is every tick, and at once."""
        counts = {"period": self._every, "latency": self._latency}
        return {name: ns_to_seconds(ticks * self._tick_ns) for name, ticks in counts.items()}

    def measures(self, tick: int) -> bool:
        """Whether the sensor measures in a tick."""
        return tick % max(1, self._every) == 0

    def put(self, memory: Memory, tick: int, values: Array, *, lost: bool = False) -> Memory:
        """Return the memory with a sample measured now, unless it is lost."""
        sample = Sample(tick, values)
        waiting = memory.waiting if lost else (*memory.waiting, sample)
        return Memory(memory.held, waiting, memory.latest or sample)

    def arriving(self, memory: Memory, tick: int) -> tuple[Memory, Sample | None]:
        """Return the memory without the sample that comes in a tick, and that sample, None if none does."""
        waiting = memory.waiting
        if not waiting or waiting[0].tick + self._latency > tick:
            return memory, None
        return Memory(memory.held, waiting[1:], waiting[0]), waiting[0]
