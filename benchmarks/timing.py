"""Fair timing on a shared machine: contestants take turns, round by round."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from time import perf_counter


@dataclass(frozen=True)
class Timings:
    """Seconds per contestant, one entry per round; entries of the same round were taken one after another."""

    seconds: Mapping[str, tuple[float, ...]]

    def best(self, name: str) -> float:
        """Return the shortest time in s: what the machine can do when nothing disturbs it."""
        return min(self.seconds[name])

    def median(self, name: str) -> float:
        """Return the median time in s."""
        return median(self.seconds[name])

    def ratio(self, name: str, other: str) -> float:
        """Return how many times as long ``name`` takes as ``other``: the median over the rounds."""
        return median(a / b for a, b in zip(self.seconds[name], self.seconds[other], strict=True))


def told_in_turn(contestants: Mapping[str, Callable[[], float]], rounds: int) -> Timings:
    """Return the times in s that contestants tell of themselves, which run A B C A B C ..."""
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, measure in contestants.items():
            seconds[name].append(measure())
    return Timings({name: tuple(times) for name, times in seconds.items()})


def interleaved(
    contestants: Mapping[str, Callable[[], object]], rounds: int, clock: Callable[[], float] = perf_counter
) -> Timings:
    """Return the times of contestants that run A B C A B C ..., after one untimed round to warm up.

    ``clock`` tells the seconds: ``time.process_time`` leaves out what other processes take, where a
    contestant is one thread.
    """
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for index in range(rounds + 1):
        for name, run in contestants.items():
            start = clock()
            run()
            if index:
                seconds[name].append(clock() - start)
    return Timings({name: tuple(times) for name, times in seconds.items()})
