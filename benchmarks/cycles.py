"""Start and stop cycles of the graph: what they leave behind, and whether the launcher grows.

Run as ``python -m benchmarks.cycles``. Every other cycle is cut short by SIGINT at a random moment, from
the start of the nodes on; the others run to their end. After each, no node may be left, nothing in shared
memory that nobody holds, no thread and no file descriptor more than after the first cycles, in which
libraries are loaded. The exit code is 1 if anything of that is found.
"""

import os
import signal
import sys
from argparse import ArgumentDefaultsHelpFormatter, ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from threading import Timer
from time import monotonic

from sms_handover.cli.main import main as sms_handover
from sms_handover.ros.process.launcher_process import LAUNCHER_PID

_LONGEST_S = 4.0  # [s] of wall time until an interrupt; a cycle takes about that
_LEARNED = 4  # cycles after which all libraries are loaded, whichever way a run ends
_EXPECTED = (0, 130)
_SHARED_MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class Left:
    """What there is after a cycle; ``segments`` are files in shared memory that nobody holds."""

    orphans: int
    segments: int
    threads: int
    descriptors: int


def main() -> int:
    """Run the cycles, print what was left, and return 1 if it was anything."""
    parser = ArgumentParser(description=__doc__, formatter_class=ArgumentDefaultsHelpFormatter)
    parser.add_argument("--cycles", type=int, default=100, help="times that the graph is started")
    parser.add_argument("--duration", type=float, default=0.2, help="simulated time of a run [s]")
    parser.add_argument("--seed", type=int, default=0, help="of the moments of the interrupts")
    options = parser.parse_args()
    random = Random(options.seed)
    before = unheld()
    seen: list[Left] = []
    with TemporaryDirectory(prefix="cycles_") as folder:
        for cycle in range(options.cycles):
            begin, after_s = monotonic(), random.uniform(0.0, _LONGEST_S) if cycle % 2 else None
            code, said = run(Path(folder) / str(cycle), options.duration, after_s)
            seen.append(look(before))
            cut = f"SIGINT after {after_s:.2f} s" if after_s is not None else "to its end"
            print(
                f"{cycle + 1:>4} {cut:<20} exit {code:>3}, {monotonic() - begin:5.1f} s, {seen[-1]}",
                flush=True,
            )
            if code not in _EXPECTED:
                print(said, file=sys.stderr)
                return 1
    return verdict(seen)


def run(output: Path, duration: float, interrupt_after_s: float | None) -> tuple[int, str]:
    """Carry out one run, cut short if wanted; return its exit code and what it said."""
    arguments = ["run", "--duration", str(duration), "--output", str(output)]
    log = output.with_suffix(".txt")
    with log.open("w", encoding="utf-8") as said, redirect_stdout(said), redirect_stderr(said):
        try:
            with interrupted(interrupt_after_s):
                code = sms_handover(arguments)
        except KeyboardInterrupt:  # it came before the command had begun, or when it was over
            code = 130
    return code, log.read_text(encoding="utf-8")


@contextmanager
def interrupted(after_s: float | None) -> Iterator[None]:
    """Send SIGINT to this process after a while, unless the context has ended."""
    if after_s is None:
        yield
        return
    timer = Timer(after_s, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def look(before: set[str]) -> Left:
    """Return what there is now, besides what lay in shared memory ``before``."""
    return Left(
        orphans=len(nodes()),
        segments=len(unheld() - before),
        threads=len(os.listdir("/proc/self/task")),
        descriptors=len(os.listdir("/proc/self/fd")),
    )


def nodes() -> list[int]:
    """Return the processes that this one has started as a launcher and that have not ended."""
    mine = f"{LAUNCHER_PID}={os.getpid()}".encode()
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if mine in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


def unheld() -> set[str]:
    """Return what Fast DDS has made in shared memory and nobody holds a lock on, and lists of dead runs."""
    found = set()
    for file in _SHARED_MEMORY.glob("*"):
        lock = file if file.name.startswith("sms_handover_") else file.with_name(f"{file.name}_el")
        is_one = file.name.startswith(("fastrtps_", "sms_handover_")) and not file.name.endswith("_el")
        if is_one and not is_held(lock):
            found.add(file.name)
    return found


def is_held(lock: Path) -> bool:
    """Whether a process holds a lock; to try it would disturb whoever is about to take it."""
    try:
        inode = lock.stat().st_ino
    except OSError:
        return False
    held = (line.split() for line in Path("/proc/locks").read_text(encoding="ascii").splitlines())
    return any(words[1] == "FLOCK" and words[5].rpartition(":")[2] == str(inode) for words in held)


def verdict(seen: list[Left]) -> int:
    """Print whether anything was left or grew; return the exit code."""
    settled, last = seen[min(_LEARNED, len(seen)) - 1], seen[-1]
    faults = [
        f"{max(left.orphans for left in seen)} orphans" if any(left.orphans for left in seen) else "",
        f"{last.segments} files left in shared memory" if last.segments else "",
        f"threads grew from {settled.threads} to {last.threads}" if last.threads > settled.threads else "",
        f"descriptors grew from {settled.descriptors} to {last.descriptors}"
        if last.descriptors > settled.descriptors
        else "",
    ]
    told = "; ".join(filter(None, faults)) or (
        f"no orphan, nothing left in shared memory, {last.threads} threads and {last.descriptors} file "
        f"descriptors from cycle {min(_LEARNED, len(seen))} to the last"
    )
    print(f"{len(seen)} cycles: {told}")
    return 1 if any(faults) else 0


if __name__ == "__main__":
    raise SystemExit(main())
