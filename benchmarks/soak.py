"""Soak test: whether anything grows or is lost during a long run.

Runs the graph in lock step over many minutes of simulated time, records it into files of a minute, looks at
its processes all the while, and holds the bag against what the nodes say they have published. Writes
docs/soak.md with a figure.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from signal import SIGINT
from time import monotonic, sleep

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

from benchmarks.machine import load_average, machine
from benchmarks.process_samples import Sample, growth, sample
from benchmarks.results import DIAGRAMS, ROOT, Table, bullets, number
from benchmarks.soak_schedule import write_schedule
from sms_handover.bag.info import read_info
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity
from sms_handover.ros.process.launcher_process import LAUNCHER_PID
from sms_handover.units import NS_PER_S

PAGE, FIGURE = ROOT / "docs" / "soak.md", DIAGRAMS / "soak.svg"
ALLOWED = 1e-3  # [1/min] growth of memory per minute of simulated time, of what a process holds in the middle
_WARM_UP = 0.2  # [-] of the run, in which caches and pools fill
_INTERRUPTED, _CUT_SHORT = 130, "the run was not finished"  # exit code of a run, finding of its bag
_PERIOD_S = 5.0  # [s] of wall time between two looks
_SPLIT_S = 60  # [s] of simulated time in a file of the bag
_PROGRESS = re.compile(r"^ *([0-9.]+) of [0-9.]+ s ", re.MULTILINE)
_NODE = "sms_handover.nodes."


@dataclass(frozen=True)
class Soak:
    """What one run has shown; ``minutes`` of the ``asked`` ones were reached; samples by process."""

    asked: float
    minutes: float
    wall_s: float
    code: int
    samples: Mapping[str, Sequence[Sample]]
    files: int
    size: int
    messages: int
    lost: int
    twice: int
    findings: Sequence[str]

    @property
    def warm_up_s(self) -> float:
        """Return the simulated time that does not count [s]."""
        return _WARM_UP * 60.0 * self.minutes

    @property
    def flat(self) -> bool:
        """Whether nothing has grown: memory by its slope, descriptors and threads by their number."""
        return all(self.growth_of(name) <= self.allowed_of(name) for name in self.samples) and not any(
            self.more_of(name) for name in self.samples
        )

    @property
    def whole(self) -> bool:
        """Whether the run ended in order and the bag has everything up to its end."""
        return self.code in (0, _INTERRUPTED) and self.lost == 0 and not self.findings

    def growth_of(self, process: str) -> float:
        """Return the growth of a process in MiB per simulated minute."""
        return growth(self.samples[process], self.warm_up_s)

    def allowed_of(self, process: str) -> float:
        """Return the growth that is allowed to a process in MiB per simulated minute."""
        late = [item.own for item in self.samples[process] if item.time_s >= self.warm_up_s]
        return ALLOWED * sorted(late)[len(late) // 2]

    def more_of(self, process: str) -> int:
        """Return how many descriptors and threads the second half had more than the first, at the most."""
        late = [item for item in self.samples[process] if item.time_s >= self.warm_up_s]
        halves = late[: len(late) // 2], late[len(late) // 2 :]
        counts = [max(item.descriptors + item.threads for item in half) for half in halves]
        return max(0, counts[1] - counts[0])


def soak(minutes: float, folder: Path, more: Sequence[str]) -> Soak:
    """Run for so many minutes of simulated time, with more options, and look."""
    schedule = write_schedule(folder / "schedule.yaml", 60.0 * minutes)
    command = [sys.executable, "-m", "sms_handover.cli.main", "run", "-o", str(folder / "run")]
    command += ["--schedule", str(schedule), "--time-law", "quintic", "--duration", str(60.0 * minutes)]
    command += ["--no-dry-run", "-p", f"recorder.split_duration:={_SPLIT_S}", *more]
    log = folder / "printed"
    begin = monotonic()
    with log.open("wb") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT)
    samples: dict[str, list[Sample]] = {}
    try:
        _watch(process, log, samples)
    except KeyboardInterrupt:
        print("\nending the run; what it has shown so far counts", flush=True)
    finally:
        if process.poll() is None:
            process.send_signal(SIGINT)
        code = process.wait()
    wall_s = monotonic() - begin
    print("going through the bag", flush=True)
    bag = folder / "run" / "bag"
    info, result = read_info(bag), check(bag)
    topics = info.ledger.topics if info.ledger else ()
    return Soak(
        asked=minutes,
        minutes=info.end_ns / NS_PER_S / 60.0,
        wall_s=wall_s,
        code=code,
        samples={name: taken for name, taken in samples.items() if len(taken) > 2},
        files=len(info.files),
        size=info.size,
        messages=info.message_count,
        lost=sum(max(0, topic.lost or 0) + topic.missing for topic in topics),
        twice=sum(topic.duplicates for topic in topics),
        findings=[
            f.text
            for f in result.findings
            if f.severity is not Severity.NOTE and not (code == _INTERRUPTED and _CUT_SHORT in f.text)
        ],
    )


def _watch(process: "subprocess.Popen[bytes]", log: Path, samples: dict[str, list[Sample]]) -> None:
    """Look at the launcher and its nodes until the run is over."""
    while process.poll() is None:
        told = _PROGRESS.findall(log.read_text(encoding="utf-8", errors="replace"))
        for name, pid in {"launcher": process.pid, **_nodes_of(process.pid)}.items():
            taken = sample(pid, float(told[-1])) if told else None
            if taken is not None:
                samples.setdefault(name, []).append(taken)
        if told:
            print(f"{float(told[-1]):.0f} s of simulated time", flush=True)
        sleep(_PERIOD_S)


def _nodes_of(launcher: int) -> dict[str, int]:
    """Return the process ids of the nodes of a launcher, by name."""
    mine, found = f"{LAUNCHER_PID}={launcher}".encode(), {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
                environment = (folder / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            names = [word.removeprefix(_NODE) for word in words if word.startswith(_NODE)]
            if names and mine in environment:
                found[names[0]] = int(folder.name)
    return found


def draw(result: Soak, path: Path) -> None:
    """Draw memory over simulated time, a line per process."""
    matplotlib.rcParams.update({"svg.hashsalt": "sms_handover", "svg.fonttype": "none"})
    figure, axes = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
    for name, taken in result.samples.items():
        axes.plot([item.time_s / 60.0 for item in taken], [item.own for item in taken], label=name, lw=1.2)
    axes.axvspan(0.0, result.warm_up_s / 60.0, color="0.93", label="warm-up")
    axes.set(xlabel="simulated time [min]", ylabel="own memory [MiB]", xlim=(0, result.minutes))
    axes.set_ylim(bottom=0)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def page(result: Soak, command: str) -> str:
    """Return the page as Markdown."""
    rows = []
    for name, taken in result.samples.items():
        late = [item for item in taken if item.time_s >= result.warm_up_s]
        rows.append(
            (
                f"`{name}`",
                f"{late[0].own:.1f}",
                f"{late[-1].own:.1f}",
                f"{1024 * result.growth_of(name):.1f}",
                f"{1024 * result.allowed_of(name):.1f}",
                _range([item.descriptors for item in late]),
                _range([item.threads for item in late]),
                f"{late[-1].pss:.0f}, {late[-1].rss:.0f}",
                _range([round(item.shared, 1) for item in late]),
            )
        )
    heading = (
        "process",
        "own memory after warm-up [MiB]",
        "at the end [MiB]",
        "growth [KiB/min]",
        "allowed [KiB/min]",
        "descriptors",
        "threads",
        "PSS, RSS at the end [MiB]",
        "shared memory mapped [MiB]",
    )
    lost = f"{result.lost} lost, {result.twice} twice"
    found = bullets(result.findings) if result.findings else "`sms-handover bag check` finds nothing."
    speed = number(60 * result.minutes / result.wall_s)
    size = f"{result.messages} messages in {result.files} files, {result.size / 1e6:.0f} MB"
    parts = [
        "# Soak",
        f"""\
`{command}` runs the graph for {result.asked:g} minutes of simulated time in lock step, with two
handovers a minute, and records it into files of a minute. It writes this page and exits with 1 if anything
grows or is lost.""",
        bullets(machine()),
        f"""\
{"" if result.code == 0 else f"This run was interrupted after {result.minutes:.1f} minutes. "}\
**Memory is {"flat" if result.flat else "NOT flat"}; {"nothing is lost" if result.whole else "NOT whole"}.**
{size}: {lost}, by the loss ledger over all files. {found}
It took {result.wall_s / 60:.0f} minutes ({speed} x real time; the machine had other work too).""",
        f"![Memory of every process over simulated time](images/{FIGURE.name})",
        f"""\
Own memory is what a process has allocated (anonymous pages): what it shares with others depends on who else
is there. Flat means: after {result.warm_up_s / 60:.1f} minutes of warm-up it grows by at most
{100 * ALLOWED:g} % per minute of simulated time, by the median of the slopes between any two samples (Theil
and Sen), and the process has no more descriptors and threads in the second half than in the first. What the
recorder holds rises with the index of the present file and falls when the next is begun.""",
        Table(heading, rows).markdown(),
    ]
    return "\n\n".join(parts) + "\n"


def _range(values: Sequence[float]) -> str:
    """Return the smallest and the largest of some numbers."""
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def main() -> int:
    """Run, write the page; the exit code is 1 if something grew or was lost."""
    parser = ArgumentParser(prog="python -m benchmarks.soak", description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="of simulated time (default: 30)")
    parser.add_argument("--compose", action="store_true", help="the nodes of the loop in one process: faster")
    parser.add_argument("--domain-id", metavar="N", help="ROS domain (default: a free one)")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name} and its figure")
    parser.add_argument("--folder", type=Path, help="new, keeps the run and samples (default: removed)")
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp(prefix="soak_"))
    if options.folder:
        folder.mkdir()
    composed = ["--compose"] if options.compose else []
    more = composed + (["--domain-id", options.domain_id] if options.domain_id else [])
    print(f"load average {load_average():.1f}; the run goes to {folder}", flush=True)
    try:
        result = soak(options.minutes, folder, more)
        if options.folder:
            (folder / "soak.json").write_text(json.dumps(asdict(result)), encoding="utf-8")
    finally:
        if not options.folder:
            shutil.rmtree(folder, ignore_errors=True)
    arguments = "".join(
        [
            "" if options.minutes == parser.get_default("minutes") else f" --minutes {options.minutes:g}",
            *(f" {option}" for option in composed),
        ]
    )
    text = page(result, f"python -m benchmarks.soak --write{arguments}")
    if options.write:
        PAGE.write_text(text, encoding="utf-8")
        draw(result, FIGURE)
    print(text)
    return 0 if result.flat and result.whole else 1


if __name__ == "__main__":
    sys.exit(main())
