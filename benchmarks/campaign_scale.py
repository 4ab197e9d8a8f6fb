"""How campaigns scale: rate, memory and bytes per case of the driver over tiny cases; overhead of workers.

``python -m benchmarks.campaign_scale`` measures and writes docs/scale.md.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.campaign_stub import row_text
from benchmarks.machine import load_average, machine
from benchmarks.results import ROOT
from docs.tables import table
from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Beside, Task, row_of
from sms_handover.campaign.definition.frozen import freeze
from sms_handover.campaign.engine.dask_workers import DaskWorkers
from sms_handover.campaign.engine.run import run_campaign
from sms_handover.campaign.record.campaign_folder import open_campaign
from sms_handover.campaign.record.cases_table import write_table
from sms_handover.campaign.record.journal import JOURNAL
from sms_handover.campaign.record.manifest import Shard

PAGE = ROOT / "docs" / "scale.md"
CASES = (100, 1000, 10_000, 100_000)
WORKERS = (1, 2)
_CASE_S = 0.5  # [s] that a stub takes for a case with workers
_PER_WORKER = 16  # [-] cases for each of them
_KB, _MB = 1e3, 1e6  # [byte]
_FILE = """\
name: scale
seed: 1
scenarios: {smooth: smooth}
laws: [nmpc]
"""


class Driver(NamedTuple):
    """What so many tiny cases cost the driver: rows per second, peak memory MB, bytes per row."""

    cases: int
    rate: float
    memory: float
    journal: float
    parquet: float


class Stubs:
    """Workers that have every row at once."""

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Yield made-up rows."""
        for task in tasks:
            yield (Done(row_of(json.loads(row_text(*task))), Beside(0.0, 0.0, "stub")),)

    def close(self) -> None:
        """There is nothing to end."""


def driver(cases: int) -> Driver:
    """Measure a campaign of so many tiny cases in this process."""
    with tempfile.TemporaryDirectory() as scratch:
        file, folder = Path(scratch) / "scale.yaml", Path(scratch) / "out"
        file.write_text(_FILE, encoding="utf-8")
        frozen, _ = freeze(file)
        with open_campaign(folder, frozen, cases, Shard()) as opened:
            begin = time.perf_counter()
            run_campaign(opened, Stubs, lambda tally: None)
            rate = cases / (time.perf_counter() - begin)
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / _MB
            write_table(Path(scratch) / "cases.parquet", opened.entries())
        sizes = [path.stat().st_size / cases for path in (folder / JOURNAL, Path(scratch) / "cases.parquet")]
    return Driver(cases, rate, memory, *sizes)


def overhead(workers: int) -> float:
    """Return the wall time in s that a case takes beyond its own, with so many workers of a cluster here."""
    stub = (sys.executable, "-m", "benchmarks.campaign_stub", str(_CASE_S))
    cases = _PER_WORKER * workers
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "scale.yaml"
        file.write_text(_FILE, encoding="utf-8")
        frozen, _ = freeze(file)
        made = DaskWorkers(frozen, cases + workers, workers=workers, program=stub)
        try:
            for _ in made.run(Task(case, "smooth", "nmpc") for case in range(workers)):  # processes start
                pass
            begin = time.perf_counter()
            for _ in made.run(Task(case, "smooth", "nmpc") for case in range(cases)):
                pass
            return (time.perf_counter() - begin) / _PER_WORKER - _CASE_S
        finally:
            made.close()


def page(drivers: Iterable[Driver], overheads: Iterable[tuple[int, float]]) -> str:
    """Return the text of the page."""
    measured = list(drivers)
    rows = [
        (f"{one.cases:,}", f"{one.rate:.0f}", f"{one.memory:.0f}", f"{one.journal:.0f}", f"{one.parquet:.0f}")
        for one in measured
    ]
    added = [
        (str(workers), f"{1e3 * more:.0f}", *(f"{case / (case + more):.3f}" for case in (_CASE_S, 3.0)))
        for workers, more in overheads
    ]
    last = measured[-1]
    million = 1e6 * last.journal / _MB
    load = f"Load: {load_average():.0f} processes wanted to run; more than there are cores make all slower"
    lines = "\n".join(f"- {line}" for line in (*machine(), load))
    minutes, hours, pace = 1e6 / last.rate / 60.0, 3e6 / 64.0 / 3600.0, 64.0 / 3.0
    return f"""\
# Scale of campaigns

This page is written by `python -m benchmarks.campaign_scale`. Nothing is simulated in it: stubs answer at
once, so that what is measured is the driver of a [campaign](campaigns.md), and then after {_CASE_S:g} s, so
that it is the workers.

{lines}

## The driver

Each row is on disk (`fsync`) before it counts. Memory is the peak of a process for each size.

{table(["Cases", "Rows per second", "Memory [MB]", "Journal [byte per row]", "Parquet [byte per row]"], rows)}

## Workers

Wall time that a case takes beyond its own, in a cluster of processes on this machine, its start not counted.

{table(["Workers", "Overhead per case [ms]", f"Efficiency at {_CASE_S:g} s", "Efficiency at 3 s"], added)}

## On paper, beyond what was measured

- 1e6 cases: a journal of {million:.0f} MB, {minutes:.0f} min of driver time for the rows alone. Cases of 3 s
  on 64 cores take {hours:.0f} h and bring {pace:.0f} rows a second.
- What breaks first is not the driver of a run but what reads all rows at once: `campaign status`, the table
  and the page hold them in memory, some kB each, so that 1e7 rows want a machine with tens of GB.
- Beyond one machine the scheduler of Dask takes some hundred tasks a second; a task is a chunk of cases.
- Not measured: more than {max(WORKERS)} workers, more than one machine.
"""


def main() -> None:
    """Measure and write the page; with ``--driver N`` measure one size and print it, for the page."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--driver", type=int, default=0, metavar="N", help="measure N cases only")
    parser.add_argument("--largest", type=int, default=CASES[-1], metavar="N", help="up to so many cases")
    options = parser.parse_args()
    if options.driver:
        print(json.dumps(driver(options.driver)))
        return
    found = []
    for cases in (cases for cases in CASES if cases <= options.largest):
        command = [sys.executable, "-m", "benchmarks.campaign_scale", "--driver", str(cases)]
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
        found.append(Driver(*json.loads(done.stdout)))
        print(found[-1], flush=True)
    overheads = [(workers, overhead(workers)) for workers in WORKERS]
    PAGE.write_text(page(found, overheads), encoding="utf-8")


if __name__ == "__main__":
    main()
