"""Startup times: imports, help, and the first tick in one process and over DDS."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import interleaved

ROUNDS = 7
GRAPH_ROUNDS = 3
_COMMAND = ("-m", "sms_handover.cli.main")
_MODULES = ("numpy", "pinocchio", "rclpy")


def finished(arguments: Sequence[str]) -> None:
    """Run the interpreter with arguments to its end."""
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)


def until_first_tick(arguments: Sequence[str]) -> float:
    """Return the time in s from the start of a command to its first line of progress, and let it end."""
    start = perf_counter()
    with subprocess.Popen(
        [sys.executable, *_COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "real time" in line:
                elapsed = perf_counter() - start
                process.stderr.read()
                return elapsed
    raise RuntimeError(
        f"sms-handover {' '.join(arguments)} showed no progress, exit code {process.returncode}"
    )


def imported_by(arguments: Sequence[str]) -> str:
    """Return which of the heavy modules a command imports."""
    lines = subprocess.run(
        [sys.executable, "-X", "importtime", *arguments], check=True, capture_output=True, text=True
    ).stderr.splitlines()
    modules = {line.rpartition("|")[2].strip() for line in lines}
    return ", ".join(name for name in _MODULES if name in modules) or "none of them"


def import_table() -> Table:
    """Return how long it takes to start and end a process that does nothing else."""
    cases = {
        "python, doing nothing": ("-c", "pass"),
        "import sms_handover": ("-c", "import sms_handover"),
        "sms-handover --help": (*_COMMAND, "--help"),
        "sms-handover simulate --help": (*_COMMAND, "simulate", "--help"),
        "sms-handover run --help": (*_COMMAND, "run", "--help"),
        "import pinocchio": ("-c", "import pinocchio"),
        "import rclpy": ("-c", "import rclpy"),
    }
    contestants: dict[str, Callable[[], None]] = {
        name: partial(finished, args) for name, args in cases.items()
    }
    times = interleaved(contestants, ROUNDS)
    rows = [row(name, 1e3 * times.median(name), imported_by(args)) for name, args in cases.items()]
    return Table(("process", "median [ms]", f"imports of {', '.join(_MODULES)}"), rows)


def first_tick_table() -> Table:
    """Return how long it takes from the command to the first tick, everything checked before it included."""
    alone = sorted(until_first_tick(("simulate", "--duration", "0.02")) for _ in range(ROUNDS))
    rows = [row("sms-handover simulate: one process", alone[len(alone) // 2])]
    with TemporaryDirectory() as folder:
        graph = sorted(
            until_first_tick(("run", "--duration", "0.02", "--output", f"{folder}/{index}"))
            for index in range(GRAPH_ROUNDS)
        )
    rows.append(row("sms-handover run: five nodes over DDS, recorder included", graph[len(graph) // 2]))
    return Table(("command", "launch to first tick, median [s]"), rows)


def main() -> None:
    """Measure and publish."""
    publish(
        Result(
            name="startup",
            question="How long until it answers?",
            notes=[
                "Whole processes, from their start to their end or to the first line of progress. Allowed "
                "are 2 s to the first tick of the graph."
            ],
            tables=[import_table(), first_tick_table()],
        )
    )


if __name__ == "__main__":
    main()
