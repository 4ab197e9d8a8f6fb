"""How campaigns scale: rate, memory and bytes per case of the driver over tiny cases; overhead of workers.

``python -m benchmarks.campaign_scale`` measures and writes docs/scale.md, and ends with an error where a
figure is beyond its bound; ``--largest 1000 --seconds 0.2 --print`` is a quick look.
"""

import json
import logging
import resource
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import dask
import distributed

from benchmarks.campaign_interrupt import leaving
from benchmarks.campaign_stub import row_text
from benchmarks.machine import load_average, machine
from benchmarks.results import ROOT
from docs.tables import table
from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Beside, Task, row_of
from sms_handover.campaign.definition.frozen import Frozen, freeze
from sms_handover.campaign.engine.dask_workers import DaskWorkers
from sms_handover.campaign.engine.run import run_campaign
from sms_handover.campaign.record.campaign_folder import open_campaign
from sms_handover.campaign.record.cases_table import write_table
from sms_handover.campaign.record.journal import JOURNAL
from sms_handover.campaign.record.manifest import Shard

PAGE = ROOT / "docs" / "scale.md"
CASES = (100, 1000, 10_000, 100_000)
CHUNK = 50  # [-] cases that come together, as those of a cluster do where they are tiny
ALONE = 1000  # [-] cases that come one by one
WORKERS = (1, 2, 4, 8, 16, 32, 64)
_PROCESSES = 2  # of workers; of more workers each is a thread of them, with a process of cases of its own
_CASE_S = 3.0  # [s] that a stub sleeps for a case
_PER_WORKER = 8  # [-] cases for each worker
_SATURATION = "distributed.scheduler.worker-saturation"
_ONE_EACH, _DASK_HAS = 1.0, 1.1  # [-] chunks of each thread that a worker has at a time
_MOST_OVERHEAD_S = 0.020  # [s] of a case of 3 s, with a worker for each process
_LEAST_EFFICIENCY = 0.95  # [-] then
_MOST_GROWTH = 1.10  # [-] of the memory of a driver, from 1e3 to 1e5 cases
_MOST_LEAVING_S = 5.0  # [s] from Ctrl-C to the end of the driver
_GB, _MB, _MS = 1e9, 1e6, 1e3
_H = 3600.0  # [s]
_TASKS = (300.0, 700.0)  # [1/s] that the scheduler of Dask takes
_TASK_S = 2.0  # [s] of work in one of them
_FILE = """\
name: scale
seed: 1
scenarios: {smooth: smooth}
laws: [nmpc]
"""


class Driver(NamedTuple):
    """What so many tiny cases cost the driver: rows per second, bytes per row, and peaks of memory in MB.

    ``running`` is while all of them are run, ``resumed`` once a journal that has them all was opened again,
    ``reading`` once its table was made of all rows.
    """

    cases: int
    rate: float
    running: float
    resumed: float
    reading: float
    journal: float
    parquet: float


class Stubs:
    """Workers that have every row at once, so many together."""

    def __init__(self, together: int) -> None:
        """Take how many rows come together."""
        self._together = together

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Yield made-up rows."""
        left = iter(tasks)
        while chunk := list(islice(left, self._together)):
            yield [Done(row_of(json.loads(row_text(*task))), Beside(0.0, 0.0, "stub")) for task in chunk]

    def close(self) -> None:
        """There is nothing to end."""


def frozen_in(folder: Path) -> Frozen:
    """Return the campaign of the stubs, written to a folder."""
    file = folder / "scale.yaml"
    file.write_text(_FILE, encoding="utf-8")
    return freeze(file)[0]


def driver(cases: int, together: int) -> Driver:
    """Measure a campaign of so many tiny cases in this process."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, parquet = Path(scratch) / "out", Path(scratch) / "cases.parquet"
        frozen = frozen_in(Path(scratch))
        begin = time.perf_counter()
        with open_campaign(folder, frozen, cases, Shard()) as opened:
            run_campaign(opened, lambda: Stubs(together), lambda tally: None)
        rate, running = cases / (time.perf_counter() - begin), peak_mb()
        with open_campaign(folder, frozen, cases, Shard()) as opened:
            run_campaign(opened, lambda: Stubs(together), lambda tally: None)  # nothing is left to do
        resumed = peak_mb()
        write_table(parquet, opened.entries())
        sizes = [path.stat().st_size / cases for path in (folder / JOURNAL, parquet)]
    return Driver(cases, rate, running, resumed, peak_mb(), *sizes)


def peak_mb() -> float:
    """Return the largest resident memory that this process has had, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / _MB


class Pace(NamedTuple):
    """Wall time in s that a case takes beyond its own, with so many workers.

    ``by_default`` is what it is with the saturation that Dask has, None where that is how we start workers.
    """

    workers: int
    overhead: float
    by_default: float | None

    def efficiency(self, seconds: float) -> float:
        """Return the share of the wall time in which a worker has a case of so many seconds."""
        return seconds / (seconds + self.overhead)


@contextmanager
def cluster(
    frozen: Frozen, cases: int, workers: int, seconds: float, saturation: float
) -> Iterator[DaskWorkers]:
    """Yield workers with stubs that sleep: a process each, or threads of a few where they are many."""
    stub = (sys.executable, "-m", "benchmarks.campaign_stub", str(seconds))
    if workers <= _PROCESSES:
        made = DaskWorkers(frozen, cases, workers=workers, program=stub)
        try:
            yield made
        finally:
            made.close()
        return
    with (
        dask.config.set({_SATURATION: saturation}),
        distributed.LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=_PROCESSES,
            threads_per_worker=workers // _PROCESSES,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=None,
            silence_logs=logging.CRITICAL,
        ) as there,
    ):
        made = DaskWorkers(frozen, cases, scheduler=there.scheduler_address, program=stub)
        try:
            yield made
        finally:
            made.close()


def pace(workers: int, seconds: float) -> Pace:
    """Return what a case takes beyond its own with so many workers, in both ways where there are two."""
    by_default = overhead(workers, seconds, _DASK_HAS) if workers > _PROCESSES else None
    return Pace(workers, overhead(workers, seconds, _ONE_EACH), by_default)


def overhead(workers: int, seconds: float, saturation: float) -> float:
    """Return the wall time in s that a case takes beyond its own, with so many workers."""
    cases = _PER_WORKER * workers
    tasks = [Task(case, "smooth", "nmpc") for case in range(cases)]
    with (
        tempfile.TemporaryDirectory() as scratch,
        cluster(frozen_in(Path(scratch)), cases, workers, seconds, saturation) as made,
    ):
        for _ in made.run(tasks[: 2 * workers]):  # until the processes have started
            pass
        begin = time.perf_counter()
        for _ in made.run(tasks):
            pass
        return (time.perf_counter() - begin) / _PER_WORKER - seconds


def growth(drivers: Sequence[Driver]) -> float:
    """Return the factor by which the memory of a running driver changes from 1e3 cases to the most."""
    return drivers[-1].running / next(one for one in drivers if one.cases >= CASES[1]).running


def beyond(
    drivers: Sequence[Driver], paces: Sequence[Pace], left: Mapping[int, float], seconds: float
) -> list[str]:
    """Return each figure that is beyond its bound, in words; bounds are of the full sizes only."""
    found = [
        f"Ctrl-C with -j {jobs}: {took:.1f} s, at most {_MOST_LEAVING_S:g} s"
        for jobs, took in left.items()
        if took > _MOST_LEAVING_S
    ]
    if drivers[-1].cases >= CASES[-1] and growth(drivers) > _MOST_GROWTH:
        sizes = f"from {CASES[1]:,} to {drivers[-1].cases:,} cases"
        found.append(f"memory of a driver {sizes}: factor {growth(drivers):.2f}, at most {_MOST_GROWTH:.2f}")
    for one in paces if seconds >= _CASE_S else ():
        if one.workers > _PROCESSES:
            continue
        where = f"with {one.workers} workers"
        if one.overhead > _MOST_OVERHEAD_S:
            figures = (_MS * one.overhead, _MS * _MOST_OVERHEAD_S)
            found.append(f"overhead of a case {where}: {figures[0]:.1f} ms, at most {figures[1]:.0f} ms")
        if one.efficiency(seconds) < _LEAST_EFFICIENCY:
            share = one.efficiency(seconds)
            found.append(f"efficiency {where}: {share:.3f}, at least {_LEAST_EFFICIENCY}")
    return found


def page(
    drivers: Sequence[Driver],
    alone: Driver,
    paces: Sequence[Pace],
    left: Mapping[int, float],
    seconds: float,
) -> str:
    """Return the text of the page."""
    rows = [
        (f"{one.cases:,}", *(f"{number:.0f}" for number in one[1:5]), *(f"{size:.0f}" for size in one[5:]))
        for one in drivers
    ]
    added = [
        (
            str(one.workers),
            f"{_MS * one.overhead:.0f}",
            f"{one.efficiency(seconds):.3f}",
            "-" if one.by_default is None else f"{_MS * one.by_default:.0f}",
        )
        for one in paces
    ]
    first, last = drivers[-2], drivers[-1]
    per_row = (last.reading - first.reading) * _MB / (last.cases - first.cases)
    again = (last.resumed - first.resumed) * _MB / (last.cases - first.cases)
    paper = [
        (
            f"{cases:.0e}".replace("e+0", "e"),
            f"{cases * seconds / _H:,.0f}",
            f"{cases * last.journal / _GB:.1f}",
            f"{cases / last.rate / _H:.1f}",
            f"{cases * again / _GB:.1f}",
            f"{cases * per_row / _GB:.1f}",
        )
        for cases in (1e5, 1e6, 1e7)
    ]
    load = f"Load: {load_average():.0f} processes wanted to run; more than there are cores make all slower"
    lines = "\n".join(f"- {line}" for line in (*machine(), load))
    memory = ["Running [MB]", "Opened again [MB]", "All rows read [MB]"]
    head = ["Cases", "Rows per second", *memory, "Journal [byte per row]", "Parquet [byte per row]"]
    paper_head = [
        "Cases",
        "Core hours",
        "Journal [GB]",
        "Hours of driver",
        "Opened again [GB]",
        "All read [GB]",
    ]
    few, many = (f"{rate * _TASK_S:.0f}" for rate in _TASKS)
    flat = growth(drivers)
    cores, most = f"{last.rate * seconds:,.0f}", WORKERS[-1]
    return f"""\
# Scale of campaigns

This page is written by `python -m benchmarks.campaign_scale`. Nothing is simulated in it: stubs answer at
once, so that what is measured is the driver of a [campaign](campaigns.md), and then after {seconds:g} s, so
that it is the workers.

{lines}

## The driver

A row is on disk (`fsync`) before it counts; rows that come together wait for the disk once, here
{CHUNK} of them. One by one there are {alone.rate:.0f} rows per second, as many as the disk takes. Memory is
the peak of a process of its own for each size: while all cases run, once the same command has opened the
finished journal again, and once all rows are read for the table.

{table(head, rows)}

From {CASES[1]:,} to {last.cases:,} cases the memory of a driver that runs them changes by a factor
of {flat:.2f}; the bound is {_MOST_GROWTH:.2f}.

## Workers

Wall time that a case of {seconds:g} s takes beyond its own, in one run of {_PER_WORKER} cases for each
worker, start not counted; efficiency is the share of the wall time in which a worker has a case. Up to
{_PROCESSES} workers are a process each, more are threads of {_PROCESSES} processes, each with a process of
cases of its own, {most} at last; the stubs sleep, so that there are no cores to be short of. With up
to {_PROCESSES} workers a case may take {_MS * _MOST_OVERHEAD_S:.0f} ms beyond its own, and efficiency must be
{_LEAST_EFFICIENCY} or more; what is not ends the command with an error.

{table(["Workers", "Overhead per case [ms]", "Efficiency", "Overhead, Dask's defaults [ms]"], added)}

Threads are measured with `{_SATURATION}` at {_ONE_EACH}, one chunk a thread, and at
the {_DASK_HAS} that Dask has: rounded up, a worker then gets a chunk more than it has threads, which may wait
there while another worker is idle. In some runs that costs a case at the end of a campaign, shared here by
{_PER_WORKER} rounds, in others nothing. Workers of `-j` have one thread each; a scheduler of yours whose
workers have many is best started with `DASK_DISTRIBUTED__SCHEDULER__WORKER_SATURATION={_ONE_EACH}`.

## Ctrl-C

Wall time from Ctrl-C to the end of `campaign run`, in the middle of cases of 60 s with ticks in Python; the
bound is {_MOST_LEAVING_S:g} s.

{table(["Workers (-j)", "Wall time [s]"], [(str(jobs), f"{took:.1f}") for jobs, took in left.items()])}

## On paper, beyond what was measured

Linear in the last two rows of the driver's table; cases of {seconds:g} s.

{table(paper_head, paper)}

What breaks first, in this order:

1. What reads all rows at once: table, page, `compare` and `campaign status`. The run goes on without them,
   and shards are tables of their own; analyse those of 1e7 cases with pyarrow, by columns.
2. Dask's scheduler, at {_TASKS[0]:g} to {_TASKS[1]:g} tasks a second. A task is a chunk of {_TASK_S:g} s of
   cases, so that {few} to {many} cores are busy; with more, shards.
3. The driver's pace of {last.rate:.0f} rows per second: cases of {seconds:g} s on {cores} cores.

Not measured: workers on more than one machine.
"""


def measured(cases: int, together: int) -> Driver:
    """Return what a driver of so many cases costs, measured in a process of its own."""
    sizes = ["--driver", str(cases), "--together", str(together)]
    command = [sys.executable, "-m", "benchmarks.campaign_scale", *sizes]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    found = Driver(*json.loads(done.stdout))
    print(found, file=sys.stderr, flush=True)
    return found


def main() -> None:
    """Measure and write the page; with ``--driver N`` measure one size and print it, for the page."""
    parser = ArgumentParser(prog="python -m benchmarks.campaign_scale", description=__doc__)
    parser.add_argument("--driver", type=int, default=0, metavar="N", help="measure N cases only")
    parser.add_argument("--together", type=int, default=CHUNK, metavar="N", help="rows that come together")
    parser.add_argument("--largest", type=int, default=CASES[-1], metavar="N", help="up to so many cases")
    parser.add_argument("--workers", type=int, default=WORKERS[-1], metavar="N", help="up to so many")
    parser.add_argument("--seconds", type=float, default=_CASE_S, metavar="S", help="that a case takes")
    parser.add_argument("--print", action="store_true", help="print the page, do not write it")
    options = parser.parse_args()
    if options.driver:
        print(json.dumps(driver(options.driver, options.together)))
        return
    drivers = [measured(cases, CHUNK) for cases in CASES if cases <= options.largest]
    alone = measured(min(ALONE, options.largest), 1)
    paces = []
    for workers in (workers for workers in WORKERS if workers <= options.workers):
        paces.append(pace(workers, options.seconds))
        print(paces[-1], file=sys.stderr, flush=True)
    left = {jobs: leaving(jobs) for jobs in (1, _PROCESSES)}
    text = page(drivers, alone, paces, left, options.seconds)
    if options.print:
        print(text)
    else:
        PAGE.write_text(text, encoding="utf-8")
    if found := beyond(drivers, paces, left, options.seconds):
        raise SystemExit(f"BEYOND ITS BOUND: {'; '.join(found)}")


if __name__ == "__main__":
    main()
