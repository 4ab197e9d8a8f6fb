"""Bounds of lock step over DDS: what the exchange of its messages takes at best, and remedies not taken."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from tempfile import TemporaryDirectory

from benchmarks.lockstep import FLOOR, GRAPH, RECORDED, SIMULATED_S, bare, graph, run_graph
from benchmarks.ping_pong import ONE, SPINNING, WATCHED
from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import told_in_turn

ROUNDS = 5
_LATENCY = "/dev/cpu_dma_latency"  # who holds it open with 0 us in it keeps idle processors awake
_AWAKE = bytes(4)

BARE_SPINNING = "the same, both look for up to 2 ms before they sleep"
BARE_ONE = "the same, a state in one message"
BARE_WATCHED = "the same, taken by a third process too"
BARE_AWAKE = "the same, idle processors kept awake"
GRAPH_GUIDANCE = "graph, trajectory and ik in one process"
GRAPH_PAIR = "graph, plant and controller in one process"
GRAPH_AWAKE = "graph, not recorded, idle processors kept awake"
RECORDED_AWAKE = "graph, recorded, idle processors kept awake"
RECORDED_AHEAD = "graph, recorded by a recorder that does not stand back"


@contextmanager
def awake() -> Iterator[None]:
    """Keep idle processors of this machine from sleeping, for a while."""
    with open(_LATENCY, "wb", buffering=0) as held:
        held.write(_AWAKE)
        yield


def kept_awake(measure: Callable[[], float]) -> float:
    """Return what is measured meanwhile."""
    with awake():
        return measure()


def composed(folder: str, together: str, arguments: Sequence[str]) -> float:
    """Return the time in s of a tick of the graph with some nodes in one process."""
    program = [sys.executable, "-m", "benchmarks.composed", together]
    return run_graph(program, folder, ["--compose", *arguments])


def contestants(folder: str) -> dict[str, Callable[[], float]]:
    """Return what takes turns; what this machine does not permit is left out."""
    alone = ["--no-record"]
    found: dict[str, Callable[[], float]] = {
        FLOOR: partial(bare, "ping"),
        BARE_SPINNING: partial(bare, "ping", SPINNING),
        BARE_ONE: partial(bare, "ping", ONE),
        BARE_WATCHED: partial(bare, "ping", WATCHED),
        GRAPH: partial(graph, folder, alone),
        GRAPH_GUIDANCE: partial(composed, folder, "trajectory,ik", alone),
        GRAPH_PAIR: partial(composed, folder, "plant,controller", alone),
        RECORDED: partial(graph, folder, []),
        RECORDED_AHEAD: partial(graph, folder, ["-p", "recorder.niceness:=0"]),
    }
    if os.access(_LATENCY, os.W_OK):
        found[BARE_AWAKE] = partial(kept_awake, found[FLOOR])
        found[GRAPH_AWAKE] = partial(kept_awake, found[GRAPH])
        found[RECORDED_AWAKE] = partial(kept_awake, found[RECORDED])
    return found


def main() -> None:
    """Measure and publish."""
    with TemporaryDirectory() as folder:
        times = told_in_turn(contestants(folder), ROUNDS)
    rows = [
        row(name, 1e6 * times.best(name), 1e6 * times.median(name), times.ratio(name, FLOOR))
        for name in times.seconds
    ]
    watched = times.ratio(RECORDED, BARE_WATCHED)
    processors = len(os.sched_getaffinity(0))
    heading = ("what", "best [us/tick]", "median [us/tick]", "times the bare one")
    publish(
        Result(
            name="bounds",
            question="What bounds lock step over DDS?",
            notes=[
                f"{SIMULATED_S:g} s at 1 kHz on {processors} processors; {ROUNDS} rounds in turn. The bare "
                "exchange hands over the messages of a tick between two processes that compute nothing. A "
                "third process that takes them, as the recorder does, but writes nothing, is the least that "
                f"recording costs: the recorded graph takes {watched:.2f} times that exchange. What one "
                "message for a whole state would gain is at most what the bare exchange gains by it; "
                "controllers of others read the two standard ones, which would go out besides, so that a "
                "recorder would take three. Two nodes in one process are what `--compose` does for all four "
                f"of the loop. Processors are kept awake by {_LATENCY}, where that is permitted."
            ],
            tables=[Table(heading, rows)],
            values={"us_per_tick": {name: [1e6 * t for t in each] for name, each in times.seconds.items()}},
        )
    )


if __name__ == "__main__":
    main()
