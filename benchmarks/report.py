"""Time and size of a report on two recorded handovers of 60 s."""

import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.results import ROOT, Result, Table, publish, row
from benchmarks.timing import interleaved
from sms_handover.cli.recorded_runs import read_all
from sms_handover.report.animation import animation
from sms_handover.report.engine import plotly_script
from sms_handover.report.page import report_page
from sms_handover.report.plots import plot_groups
from sms_handover.report.recorded_run import RecordedRun, compare_recorded

ROUNDS = 3
LAWS = ("nmpc", "pid")
LONGEST_S, LARGEST_MB = 20.0, 30.0  # s and MB that a report of two runs of 60 s may take
_MB = 1e6  # [byte]
_COMMAND = (sys.executable, "-m", "sms_handover.cli.main")


def record(folder: Path) -> list[Path]:
    """Record the shipped handover under both laws and return the output folders."""
    for law in LAWS:
        command = (*_COMMAND, "run", "--controller", law, "--output", str(folder / law))
        subprocess.run(command, check=True, capture_output=True)
    return [folder / law for law in LAWS]


def measure(paths: Sequence[Path], folder: Path) -> Result:
    """Return the cost of a report of these runs."""
    page = folder / "report.html"
    command = (*_COMMAND, "report", *map(str, paths), "--output", str(page), "--overwrite")
    runs: tuple[RecordedRun, ...] = read_all(paths)
    clearances = [item.clearance for item in compare_recorded(runs).runs.values()]
    times = interleaved(
        {
            "the whole command": lambda: subprocess.run(command, check=True, capture_output=True),
            "reading the bags": lambda: read_all(paths),
            "signals, thinned": lambda: plot_groups([run.data for run in runs]),
            "scenes for the animation": lambda: animation(runs, clearances),
            "the page, both of these included": lambda: report_page(runs),
        },
        ROUNDS,
    )
    whole_s, size_mb = times.median("the whole command"), page.stat().st_size / _MB
    parts = {
        "the page": size_mb,
        "of it plotly.js": len(plotly_script()) / _MB,
        "of it the animation, three.js included": len(animation(runs, clearances).html) / _MB,
    }
    verdict = (
        f"Allowed are {LONGEST_S:g} s and {LARGEST_MB:g} MB; "
        f"{'both are' if whole_s < LONGEST_S and size_mb < LARGEST_MB else 'that is NOT'} kept."
    )
    return Result(
        name="report",
        question="What does a report cost?",
        notes=[f"One page on two recorded runs of 60 s, from the command line. {verdict}"],
        tables=[
            Table(("step", "median [s]"), [row(name, times.median(name)) for name in times.seconds]),
            Table(("part", "size [MB]"), [row(name, size) for name, size in parts.items()]),
        ],
        values={"whole_s": whole_s, "size_mb": size_mb},
    )


def main() -> None:
    """Measure and publish."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument(
        "runs", nargs="*", type=Path, help="recorded runs (default: runs/nmpc and runs/pid, or new ones)"
    )
    paths = parser.parse_args().runs
    made = [ROOT / "runs" / law for law in LAWS]
    with TemporaryDirectory() as folder:
        if not paths:
            paths = made if all(path.is_dir() for path in made) else record(Path(folder))
        publish(measure(paths, Path(folder)))


if __name__ == "__main__":
    main()
