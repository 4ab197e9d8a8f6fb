"""Keeps the plant's loop on the wall clock, and accounts for how well it keeps to it."""

from math import sqrt
from time import monotonic

from sms_handover_interfaces.msg import LoopTiming

from sms_handover.units import ns_to_seconds

_IDLE_S = 0.1  # [s] wait while the loop does not run


class LoopClock:
    """Absolute deadlines one tick apart, and statistics of the periods between ticks.

    In lock step nothing is due: only the statistics are kept.
    """

    def __init__(self, tick_ns: int) -> None:
        """Prepare for ticks of this length."""
        self._tick_s = ns_to_seconds(tick_ns)
        self._deadline: float | None = None
        self._last = 0.0
        self._ticks = self._late = self._held = 0
        self._clear()

    def start(self) -> None:
        """Begin, or go on after a pause: the first tick is due one period from now."""
        self._last = monotonic()
        self._deadline = self._last + self._tick_s
        self._clear()

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
        period = now - self._last
        self._last = now
        self._ticks += 1
        self._held += held
        self._count += 1
        self._sum += period
        self._squares += period * period
        self._longest = max(self._longest, period)
        if self._deadline is not None:
            self._late += now - self._deadline > self._tick_s
            self._deadline += self._tick_s

    def report(self, now: float) -> LoopTiming:
        """Return the statistics since the last report and begin the next."""
        count = max(self._count, 1)
        mean = self._sum / count
        wall = max(now - self._since, 1e-9)
        message = LoopTiming(
            ticks=self._ticks,
            late_ticks=self._late,
            held_commands=self._held,
            period_mean=mean,
            period_std=sqrt(max(self._squares / count - mean * mean, 0.0)),
            period_max=self._longest,
            real_time_factor=self._count * self._tick_s / wall,
        )
        self._clear()
        return message

    def _clear(self) -> None:
        """Begin a new interval of statistics."""
        self._since = monotonic()
        self._count = 0
        self._sum: float = 0.0
        self._squares: float = 0.0
        self._longest: float = 0.0
