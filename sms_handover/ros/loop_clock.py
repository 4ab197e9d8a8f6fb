"""Keeps the plant's loop on the wall clock, and accounts for how well it keeps to it."""

from dataclasses import dataclass
from math import sqrt
from time import monotonic

from sms_handover_interfaces.msg import LoopTiming

from sms_handover.units import ns_to_seconds

_IDLE_S = 0.1  # [s] wait while the loop does not run


@dataclass
class _Interval:
    """Sums over the ticks since the last report."""

    since: float
    count: int = 0
    total: float = 0.0
    squares: float = 0.0
    longest: float = 0.0

    def add(self, period: float) -> None:
        """Account for one period between two ticks."""
        self.count += 1
        self.total += period
        self.squares += period * period
        self.longest = max(self.longest, period)


class LoopClock:
    """Absolute deadlines one tick apart, and statistics of the periods between ticks.

    In lock step (``paced`` false) nothing is ever due or late: only the statistics are kept.
    """

    def __init__(self, tick_ns: int, *, paced: bool) -> None:
        """Prepare for ticks of this length."""
        self._tick_s = ns_to_seconds(tick_ns)
        self._paced = paced
        self._deadline: float | None = None
        self._last = 0.0
        self._ticks = self._late = self._held = 0
        self._interval = _Interval(monotonic())

    def start(self) -> None:
        """Begin, or go on after a pause: the first tick is due one period from now."""
        self._last = monotonic()
        self._deadline = self._last + self._tick_s if self._paced else None
        self._interval = _Interval(self._last)

    def stop(self) -> None:
        """Have nothing due until the next start."""
        self._deadline = None

    def wait_s(self) -> float:
        """Return how long to wait for the next deadline, at least zero."""
        if self._deadline is None:
            return _IDLE_S
        return min(max(self._deadline - monotonic(), 0.0), _IDLE_S)

    def due(self) -> bool:
        """Tell whether the deadline has come."""
        return self._deadline is not None and monotonic() >= self._deadline

    def ticked(self, *, held: bool = False) -> None:
        """Account for a tick; it is late if it began more than one period behind its deadline."""
        now = monotonic()
        self._interval.add(now - self._last)
        self._last = now
        self._ticks += 1
        self._held += held
        if self._deadline is not None:
            self._late += now - self._deadline > self._tick_s
            self._deadline += self._tick_s

    def report(self) -> LoopTiming:
        """Return the statistics since the last report and begin the next."""
        done, now = self._interval, monotonic()
        count = max(done.count, 1)
        mean = done.total / count
        self._interval = _Interval(now)
        return LoopTiming(
            ticks=self._ticks,
            late_ticks=self._late,
            held_commands=self._held,
            period_mean=mean,
            period_std=sqrt(max(done.squares / count - mean * mean, 0.0)),
            period_max=done.longest,
            real_time_factor=done.count * self._tick_s / max(now - done.since, self._tick_s),
        )
