"""Loop clock: keeps the plant on the wall clock, with statistics of how well."""

from array import array
from dataclasses import dataclass, field
from math import ceil, inf, sqrt
from time import monotonic

from diagnostic_msgs.msg import DiagnosticStatus
from sms_handover_interfaces.msg import LoopTiming

from sms_handover.units import ns_to_seconds

LATENCY_BIN_S = 50e-6  # [s] width of the bins of the latency from a state to its command
LATENCY_BINS = 41  # the last one counts everything from 2 ms on

_REPORT_S = 1.0  # [s] at least between two reports of skipped lag
_IDLE_S = 0.1  # [s] wait while the loop does not run
# Thresholds as the controller manager of ros2_control ships them, for the mean over one report
_RATE_ERRORS_HZ = (5.0, 10.0)  # [Hz] off the wanted rate: warning, error
_EXECUTION_S = (1e-3, 2e-3)  # [s] of work in a tick: warning, error


@dataclass
class _Interval:
    """What happened in the ticks since the last report."""

    since: float
    periods: "array[float]" = field(default_factory=lambda: array("d"))
    executions: "array[float]" = field(default_factory=lambda: array("d"))
    latencies: list[int] = field(default_factory=lambda: [0] * LATENCY_BINS)
    latency_max: float = 0.0


class LoopClock:
    """Absolute deadlines one tick apart, and statistics of the periods between ticks.

    A lag of more than ``catch_up_s`` (and a tick) is skipped: the deadlines start again at the tick that is
    due, so that simulated time stays behind by it. In lock step (``paced`` false) nothing is ever due or
    late: only the statistics are kept.
    """

    def __init__(self, tick_ns: int, *, paced: bool, catch_up_s: float) -> None:
        self._tick_s = ns_to_seconds(tick_ns)
        self._paced = paced
        self._catch_up_s = max(catch_up_s, self._tick_s)
        self._deadline: float | None = None
        self._last = self._published = 0.0
        self._ticks = self._late = self._held = 0
        self.skipped_s = self._unreported_s = 0.0
        self._reported_at = -inf
        self._interval = _Interval(monotonic())
        self._level: tuple[int, str] = (0, "")
        self._since: float | None = None
        self._ran = 0.0

    def start(self) -> None:
        """Start, or resume after a pause: the first tick is due one period from now."""
        self._last = self._published = monotonic()
        self._deadline = self._last + self._tick_s if self._paced else None
        self._interval = _Interval(self._last)
        if self._since is None:
            self._since = self._last

    def stop(self) -> None:
        """Have nothing due until the next start."""
        self._deadline = None
        self._ran, self._since = self.ran, None

    def reset(self) -> None:
        """Count the ticks and the wall time of a run from now on."""
        self._ticks = self._late = self._held = 0
        self.skipped_s = self._unreported_s = 0.0
        self._level = (0, "")
        self._ran = 0.0
        if self._since is not None:
            self._since = monotonic()

    @property
    def ran(self) -> float:
        """The wall time in s that the loop has run, without pauses."""
        return self._ran if self._since is None else self._ran + monotonic() - self._since

    def wait_s(self) -> float:
        """Return the time in s to the next deadline, at least zero."""
        if self._deadline is None:
            return _IDLE_S
        return min(max(self._deadline - monotonic(), 0.0), _IDLE_S)

    def due(self) -> bool:
        """Whether the deadline has come."""
        return self._deadline is not None and monotonic() >= self._deadline

    def ticked(self, *, held: bool = False) -> None:
        """Account for the start of a tick; it is late if more than one period behind its deadline."""
        now = monotonic()
        self._interval.periods.append(now - self._last)
        self._last = now
        self._ticks += 1
        self._held += held
        if self._deadline is not None:
            lag_s = now - self._deadline
            self._late += lag_s > self._tick_s
            if lag_s > self._catch_up_s:
                self.skipped_s += lag_s
                self._unreported_s += lag_s
                self._deadline = now
            self._deadline += self._tick_s

    def take_skipped(self) -> float:
        """Return the lag in s skipped since a call last returned any, at most once per second, else 0."""
        if not self._unreported_s or monotonic() - self._reported_at < _REPORT_S:
            return 0.0
        skipped_s, self._unreported_s = self._unreported_s, 0.0
        self._reported_at = monotonic()
        return skipped_s

    def published(self) -> None:
        """Account for the state of the tick being out: its work is done."""
        self._published = monotonic()
        self._interval.executions.append(self._published - self._last)

    def answered(self) -> None:
        """Account for the command that answers the state published last."""
        latency = monotonic() - self._published
        interval = self._interval
        interval.latencies[min(int(latency / LATENCY_BIN_S), LATENCY_BINS - 1)] += 1
        interval.latency_max = max(interval.latency_max, latency)

    @property
    def misses(self) -> str:
        """What real time has cost so far, in words; "" if every tick was in time."""
        if not self._late and not self._held:
            return ""
        skipped = f", and {self.skipped_s:.3g} s of lag were skipped" if self.skipped_s else ""
        return (
            f"real time was not kept: of {self._ticks} ticks {self._late} began more than a tick late and "
            f"{self._held} held an old command{skipped}; run in lock step, or with a longer tick"
        )

    @property
    def diagnosis(self) -> tuple[int, str]:
        """Level and text for the last report, by the thresholds that ros2_control ships."""
        return self._level

    def report(self) -> LoopTiming:
        """Return the statistics since the last report and begin the next."""
        done, now = self._interval, monotonic()
        count = max(len(done.periods), 1)
        mean = sum(done.periods) / count
        errors = sorted(abs(period - self._tick_s) for period in done.periods)
        self._interval = _Interval(now)
        work = sum(done.executions) / max(len(done.executions), 1)
        self._level = self._diagnose(mean, work) if done.periods else (0, "")
        return LoopTiming(
            ticks=self._ticks,
            late_ticks=self._late,
            held_commands=self._held,
            period_mean=mean,
            period_std=sqrt(sum((period - mean) ** 2 for period in done.periods) / count),
            period_max=max(done.periods, default=0.0),
            real_time_factor=len(done.periods) * self._tick_s / max(now - done.since, self._tick_s),
            period_error_p99=errors[ceil(0.99 * len(errors)) - 1] if errors else 0.0,
            execution_mean=work,
            execution_max=max(done.executions, default=0.0),
            latency_bin=LATENCY_BIN_S,
            latency_counts=done.latencies,
            latency_max=done.latency_max,
        )

    def _diagnose(self, mean: float, work: float) -> tuple[int, str]:
        """Return level and text for a mean period and a mean time of work, both in s."""
        if not self._paced:
            return 0, ""
        rate, wanted = 1.0 / mean, 1.0 / self._tick_s
        off, slow = _level(abs(rate - wanted), _RATE_ERRORS_HZ), _level(work, _EXECUTION_S)
        words = [f"{rate:.0f} Hz instead of {wanted:.0f} Hz"] * bool(off)
        words += [f"a tick takes {1e6 * work:.0f} us"] * bool(slow)
        return max(off, slow), ", ".join(words)


def _level(value: float, thresholds: tuple[float, float]) -> int:
    """Return the diagnostics level of a value between the thresholds of warning and error."""
    warning, error = thresholds
    levels = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
    return int.from_bytes(levels[(value > warning) + (value > error)], "little")
