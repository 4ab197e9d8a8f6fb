"""Real time at 1 kHz: jitter and late ticks, compared with a process that only sleeps."""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import accumulate, pairwise
from math import ceil
from os import cpu_count, getloadavg, sched_getaffinity, sched_setaffinity
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.results import Result, Table, publish, row
from sms_handover.bag.files import read_messages
from sms_handover.graph.topics import JOINT_STATES, LOOP_TIMING
from sms_handover.messages.message_types import MessageTypes

TICK_NS = 1_000_000  # [ns]
DURATION_S = 60.0  # s of simulated and of wall time per case
_START_S = 3.0  # s that the graph takes to begin, in which the sleeper sleeps alone
_BUSY = "while True: pass"

_FIRST = ("-p", "common.priority:=50")
_AWAKE = ("-p", "plant.busy_wait:=0.001")
_FEW, _MORE = 2, 4  # [-] processors
CASES: dict[str, tuple[bool, tuple[str, ...]]] = {
    "as found, a process per node": (False, ()),
    "as found, --compose": (False, ("--compose",)),
    "as found, --compose, never asleep": (False, ("--compose", *_AWAKE)),
    "as found, --compose, never asleep, compiled dynamics": (
        False,
        ("--compose", *_AWAKE, "--dynamics", "compiled"),
    ),
    "as found, --compose, priority 50": (False, ("--compose", *_FIRST)),
    "every processor busy, --compose": (True, ("--compose",)),
    "every processor busy, --compose, priority 50": (True, ("--compose", *_FIRST)),
}


@contextmanager
def load(wanted: bool) -> Iterator[None]:
    """Keep every processor busy for a while, if wanted."""
    processes = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range((cpu_count() or 1) * wanted)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def run_graph(folder: Path, arguments: Sequence[str]) -> Path:
    """Run the graph in real time, not lock step, and return its bag; raises RuntimeError if there is none."""
    command = [sys.executable, "-m", "sms_handover.cli.main", "run", "--real-time", "--overwrite"]
    command += ["--no-dry-run"]
    command += ["--duration", str(DURATION_S), "--output", str(folder / "run"), *arguments]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if not (folder / "run" / "bag").exists():
        raise RuntimeError(done.stderr)
    return folder / "run" / "bag"


def reports(bag: Path) -> list[Any]:
    """Return the reports of the loop, one for each second."""
    types = MessageTypes()
    messages = read_messages(bag, {f"/{LOOP_TIMING}"})
    return [types.deserialize(message.data, message.type) for message in messages]


def sending_error(bag: Path) -> float:
    """Return what 99 % of all periods between two states were off the tick by at most, in s, when sent."""
    sent_ns = [message.publish_time_ns for message in read_messages(bag, {f"/{JOINT_STATES}"})]
    errors = sorted(abs(after - before - TICK_NS) for before, after in pairwise(sent_ns))
    return 1e-9 * errors[ceil(0.99 * len(errors)) - 1]


def quantile(counts: Sequence[int], width: float, part: float) -> float:
    """Return the upper end of the bin of a histogram below which a part of it lies."""
    sums = list(accumulate(counts))
    return width * (1 + next(index for index, value in enumerate(sums) if value >= part * sums[-1]))


@contextmanager
def restricted(count: int) -> Iterator[None]:
    """Let what is started meanwhile have so many processors only."""
    every = sched_getaffinity(0)
    sched_setaffinity(0, sorted(every)[:count])
    try:
        yield
    finally:
        sched_setaffinity(0, every)


def counts(processors: int) -> tuple[int, ...]:
    """Return on how many processors a process per node is measured: on four too where there are more."""
    return (_FEW, _MORE) if processors >= _MORE else (processors,)


def case(name: str, folder: Path, processors: int) -> tuple[str, ...]:
    """Return the row of one case."""
    busy, arguments = CASES[name]
    with restricted(processors), load(busy):
        command = [sys.executable, "-m", "benchmarks.sleeper", str(DURATION_S + _START_S)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sleeper:
            try:
                bag = run_graph(folder, arguments)
            except RuntimeError as error:
                sleeper.kill()
                return row(name, str(processors), str(error).strip().splitlines()[-1], *["-"] * 10)
            noise = json.loads(sleeper.communicate()[0])
    told = reports(bag)
    last = told[-1]
    latencies = [sum(column) for column in zip(*(report.latency_counts for report in told), strict=True)]
    return row(
        name,
        f"{processors}",
        f"{last.ticks}",
        f"{last.late_ticks}",
        f"{last.held_commands}",
        1e6 * sending_error(bag),
        1e6 * median(report.period_error_p99 for report in told),
        1e6 * max(report.period_error_p99 for report in told),
        1e6 * max(report.period_max for report in told),
        1e6 * quantile(latencies, last.latency_bin, 0.5),
        1e6 * quantile(latencies, last.latency_bin, 0.99),
        noise["p99_us"],
        noise["max_us"],
    )


def main() -> None:
    """Measure and publish."""
    found = getloadavg()[0]
    with TemporaryDirectory() as folder:
        every = len(sched_getaffinity(0))
        first, *others = CASES
        rows = [case(first, Path(folder), count) for count in counts(every)]
        rows += [case(name, Path(folder), every) for name in others]
    heading = (
        "machine",
        "processors",
        "ticks",
        "late",
        "held commands",
        "period off by, p99 of all [us]",
        "of the median second [us]",
        "of the worst second [us]",
        "longest period [us]",
        "state to command, p50 [us]",
        "p99 [us]",
        "bare sleeper off by, p99 [us]",
        "largest [us]",
    )
    publish(
        Result(
            name="realtime",
            question="Is real time kept at 1 kHz?",
            notes=[
                f"{DURATION_S:g} s of the whole graph, recorded. A tick is late if it begins more than a "
                "tick behind its deadline; a command is held where none has come in time. The p99 of all is "
                "by the times at which states were sent, those of single seconds by the plant's own clock. "
                "Never asleep is `-p plant.busy_wait:=0.001`. The bare sleeper "
                "is a process beside it that only wakes every ms: what it is off is the machine's doing. "
                "With --compose plant and controller are in one process, the other nodes in their own. A "
                "command of another process comes after two wake-ups of sleeping threads on each way: where "
                "the bare sleeper, which is woken once, is off by a good part of a tick, commands have to be "
                "held, and a longer tick, --compose or lock step is the remedy, as the run says beforehand. "
                f"As found, the machine had a load average of {found:.1f}, where 0 is idle."
            ],
            tables=[Table(heading, rows)],
        )
    )


if __name__ == "__main__":
    main()
