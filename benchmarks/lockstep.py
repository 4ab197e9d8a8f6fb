"""Speed of lock step over DDS, compared with the bare exchange of the same messages."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import told_in_turn
from sms_handover.simulation.parameters import COMPILED as COMPILED_DYNAMICS
from sms_handover.simulation.parameters import PINOCCHIO
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

ROUNDS = 3
SIMULATED_S = 4.0  # s of simulated time per run
TICKS = round(SIMULATED_S * 1e3)
TRIPS = 5000
_CPU = max(os.sched_getaffinity(0))
_COMPILED = ("--dynamics", "compiled")
_EXECUTOR = ("-p", "common.transport:=executor")
_FACTOR = re.compile(r"([\d.]+) x real time")

FLOOR = "bare exchange of the same messages between two processes, no work"
SOLO = "the same between two nodes of one process"
ALONE = "one process, no DDS"
ALONE_COMPILED = "one process, no DDS, compiled dynamics"
GRAPH = "graph, not recorded"
ASLEEP = "graph, not recorded, without spinning"
RECORDED = "graph, recorded"
COMPOSED = "graph with --compose, not recorded"
COMPOSED_RECORDED = "graph with --compose, recorded"
COMPILED = "graph with --compose and compiled dynamics, not recorded"
COMPILED_RECORDED = "graph with --compose and compiled dynamics, recorded"
ONE_CPU = "graph on one processor, not recorded"
FALLBACK = "graph by rclpy's executor, not recorded"
COMPOSED_FALLBACK = "graph with --compose by rclpy's executor, not recorded"


def bare(role: str, *variant: str) -> float:
    """Return the time in s of a bare round trip."""
    command = [sys.executable, "-m", "benchmarks.ping_pong", role, str(TRIPS), *variant]
    return 1e-6 * float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def alone(dynamics: str) -> float:
    """Return the time in s of a tick in one process."""
    scenario = load_scenario("paper", {"common": {"duration": SIMULATED_S, "dynamics": dynamics}})
    start = perf_counter()
    simulate(scenario)
    return (perf_counter() - start) / TICKS


def graph(folder: str, arguments: Sequence[str]) -> float:
    """Return the time in s of a tick of the graph; raises CalledProcessError, on a lost message too."""
    return run_graph([sys.executable, "-m", "sms_handover.cli.main"], folder, arguments)


def run_graph(program: Sequence[str], folder: str, arguments: Sequence[str]) -> float:
    """Return the time in s of a tick of the graph that a program starts as sms-handover does."""
    command = [*program, "run", "--no-dry-run", "--overwrite", "--duration", str(SIMULATED_S)]
    command += ["--output", f"{folder}/run", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return 1e-3 / float(_FACTOR.findall(done.stderr)[-1])


def main() -> None:
    """Measure and publish."""
    with TemporaryDirectory() as folder:
        contestants: dict[str, Callable[[], float]] = {
            FLOOR: partial(bare, "ping"),
            SOLO: partial(bare, "solo"),
            ALONE: partial(alone, PINOCCHIO),
            ALONE_COMPILED: partial(alone, COMPILED_DYNAMICS),
            GRAPH: partial(graph, folder, ["--no-record"]),
            ASLEEP: partial(graph, folder, ["--no-record", "-p", "common.spin:=0.0"]),
            RECORDED: partial(graph, folder, []),
            COMPOSED: partial(graph, folder, ["--compose", "--no-record"]),
            COMPOSED_RECORDED: partial(graph, folder, ["--compose"]),
            COMPILED: partial(graph, folder, ["--compose", "--no-record", *_COMPILED]),
            COMPILED_RECORDED: partial(graph, folder, ["--compose", *_COMPILED]),
            ONE_CPU: partial(graph, folder, ["--no-record", "-p", f"common.cpu:={_CPU}"]),
            FALLBACK: partial(graph, folder, ["--no-record", *_EXECUTOR]),
            COMPOSED_FALLBACK: partial(graph, folder, ["--compose", "--no-record", *_EXECUTOR]),
        }
        times = told_in_turn(contestants, ROUNDS)
    rows = [
        row(name, 1e6 * best, 1e6 * times.median(name), 1e-3 / best, times.ratio(name, FLOOR))
        for name, best in ((name, times.best(name)) for name in times.seconds)
    ]
    heading = ("what", "best [us/tick]", "median [us/tick]", "best: times real time", "times the bare one")
    publish(
        Result(
            name="lockstep",
            question="How fast is lock step over DDS?",
            notes=[
                f"{SIMULATED_S:g} s at 1 kHz, a reference with inverse kinematics by service every 20 ms; "
                f"{ROUNDS} rounds in turn. The bare exchange is two processes that hand each other the two "
                "messages of a state and the command, with the same bytes, quality of service and way of "
                "taking them; its time depends on which processors the system puts the two on. With "
                "--compose the four nodes of the loop are in one process and thread. One process without DDS "
                "includes reading the scenario."
            ],
            tables=[Table(heading, rows)],
            values={"us_per_tick": {name: [1e6 * t for t in each] for name, each in times.seconds.items()}},
        )
    )


if __name__ == "__main__":
    main()
