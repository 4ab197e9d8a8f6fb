"""Wake-ups of this machine: how long one process takes to hand something to another and to get it back.

In real time with a process per node a command has to come within its tick, and most of what it takes is that
sleeping processes are woken. So this is measured before such a run begins, with two processes that only hand
a byte to each other, once per tick.
"""

import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil
from time import monotonic, sleep

_ECHO = "import os\nwhile data := os.read(0, 1):\n    os.write(1, data)"
_HANDOVERS = 2  # [-] sleeping threads that a message wakes on its way: of the middleware, then of the node
_WORK_S = 3e-4  # [s] of a tick that plant and controller work, each in a process of its own
_FEW = 0.01  # [-] part of commands that may be late before something else is recommended
_LONGER_TICKS_S = (0.002, 0.004, 0.005, 0.01)  # [s]
_MS_PER_S = 1e3  # [ms/s]


@dataclass(frozen=True)
class WakeUps:
    """Seconds, by tick: ``late_s`` by which a sleep ended late, ``round_trip_s`` to a process and back."""

    late_s: tuple[float, ...]
    round_trip_s: tuple[float, ...]

    def missed(self, tick_s: float, *, composed: bool) -> float:
        """Return which part of the ticks is to be expected to miss what it needs, 0 to 1.

        With a process per node that is a command in time. ``composed`` is whether plant and controller share
        a process: nothing is woken between them, and a tick can only begin more than a tick too late.
        """
        if composed:
            return _part(late > tick_s for late in self.late_s)
        return _part(_HANDOVERS * trip + _WORK_S > tick_s for trip in self.round_trip_s)

    def forecast(self, tick_s: float, reference_s: float, *, composed: bool) -> str:
        """Return in one line what to expect of a run in real time, and what to take instead."""
        missed = self.missed(tick_s, composed=composed)
        kind, values = ("wake-ups", self.late_s) if composed else ("round trips", self.round_trip_s)
        found = f"99 % of {kind} take up to {_MS_PER_S * _quantile(values, 0.99):.2f} ms here"
        text = f"real time with a tick of {_MS_PER_S * tick_s:g} ms: {found}"
        if missed <= _FEW:
            return f"{text}, which it bears"
        ways = [] if composed else ["--compose"]
        longer = (t for t in _LONGER_TICKS_S if t > tick_s and round(reference_s / t, 9).is_integer())
        fitting = next((t for t in longer if self.missed(t, composed=composed) <= _FEW), None)
        if fitting is not None:
            ways.append(f"-p common.tick:={fitting:g}")
        ways.append("lock step, without --real-time")
        late = f"expect about {100.0 * missed:.0f} % of the {'ticks' if composed else 'commands'} too late"
        return f"{text}; {late}; better: {' or '.join(ways)}"


def measure_wake_ups(tick_s: float, duration_s: float = 1.0) -> WakeUps:
    """Return what wake-ups take, once per tick for a while, as a plant in real time asks for them."""
    late, trips = [], []
    with subprocess.Popen(
        (sys.executable, "-I", "-S", "-c", _ECHO), stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    ) as other:
        assert other.stdin is not None and other.stdout is not None
        other.stdin.write(b".")
        other.stdout.read(1)  # it has started
        begin = monotonic()
        for number in range(1, ceil(duration_s / tick_s) + 1):
            due = max(begin + number * tick_s, monotonic())
            sleep(max(due - monotonic(), 0.0))
            woken = monotonic()
            other.stdin.write(b".")
            other.stdout.read(1)
            late.append(woken - due)
            trips.append(monotonic() - woken)
        other.stdin.close()
    return WakeUps(tuple(late), tuple(trips))


def _part(cases: Iterable[bool]) -> float:
    found = list(cases)
    return sum(found) / len(found)


def _quantile(values: Sequence[float], part: float) -> float:
    return sorted(values)[ceil(part * len(values)) - 1]
