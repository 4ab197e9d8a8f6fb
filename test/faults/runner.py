"""Tries faults, each in a process of its own, several at a time if wanted."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from secrets import token_hex
from time import monotonic
from typing import Any

from .attempt import OWN_MOUNTS, read_outcome
from .fault import Family, Fault
from .leftovers import MARK, end_all, of_trial
from .outcome import Outcome, Status

ROOT = Path(__file__).resolve().parents[2]

Job = tuple[Family, Fault[Any]]


def run_all(
    jobs: Sequence[Job], seed: int, parallel: int, folder: Path | None, told: Callable[[Outcome], None]
) -> list[Outcome]:
    """Try every fault and return the outcomes in the same order; each is ``told`` when it is there.

    The files of an attempt are kept in ``folder``; without one only those of a broken promise are.
    """
    with ThreadPoolExecutor(parallel) as pool:
        futures = {pool.submit(run_one, *job, seed, folder): index for index, job in enumerate(jobs)}
        outcomes: dict[int, Outcome] = {}
        try:
            for future in as_completed(futures):
                outcomes[futures[future]] = future.result()
                told(future.result())
        except KeyboardInterrupt:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return [outcomes[index] for index in range(len(jobs))]


def run_one(family: Family, fault: Fault[Any], seed: int, kept_in: Path | None = None) -> Outcome:
    """Try one fault in a process of its own, and end whatever is left of it."""
    name = f"{family.name}/{fault.name}"
    with _folder_for(name, kept_in) as folder:
        outcome = _in_a_process(name, fault.timeout_s, seed, folder)
        if outcome.status is Status.BROKEN and kept_in is None:
            copy = Path(tempfile.mkdtemp(prefix=f"broken_{fault.name}_"))
            folder.rename(copy)
            outcome = replace(outcome, note=f"its files are in {copy}")
    return outcome


def _in_a_process(name: str, timeout_s: float, seed: int, folder: Path) -> Outcome:
    """Start the process, wait for it, and look for what it has left."""
    mark = token_hex(8)
    environment = {
        **os.environ,
        MARK: mark,
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
        "OPENBLAS_NUM_THREADS": "1",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_STATIC_PEERS": "",
        **({OWN_MOUNTS: "1"} if own_mounts() else {}),
    }
    words = [sys.executable, str(Path(__file__).parent), "--attempt", name, "--seed", str(seed)]
    begin = monotonic()
    with (folder / "attempt.log").open("wb") as log:
        process = subprocess.Popen(
            [*own_mounts(), *words, "--folder", str(folder)],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        try:
            process.wait(timeout_s)
            late = False
        except subprocess.TimeoutExpired:
            late = True
        finally:
            left = of_trial(mark)
            end_all(left)
            process.wait()
    outcome = read_outcome(folder)
    if outcome is None:
        what = (
            f"not at an end after {timeout_s:g} s" if late else f"the attempt itself ended: {_tail(folder)}"
        )
        return Outcome(name, Status.BROKEN, what, wall_s=monotonic() - begin)
    if left and outcome.status is Status.KEPT:
        outcome = replace(outcome, status=Status.BROKEN, reason=f"left behind: {'; '.join(left.values())}")
    return outcome


@cache
def own_mounts() -> tuple[str, ...]:
    """Return the command that gives a process mounts of its own, () where that is not permitted."""
    for extra in ((), ("--user", "--map-root-user")):
        command = ("unshare", *extra, "--mount", "--propagation", "private")
        try:
            probe = [*command, "mount", "-t", "tmpfs", "tmpfs", "/dev/shm"]
            done = subprocess.run(probe, capture_output=True, check=False)
        except FileNotFoundError:
            return ()
        if done.returncode == 0:
            return command
    return ()


@contextmanager
def _folder_for(name: str, kept_in: Path | None) -> Iterator[Path]:
    """Make the folder of an attempt; it stays only where it was asked for."""
    if kept_in is not None:
        folder = (kept_in / name.replace("/", "_")).resolve()
        folder.mkdir(parents=True)
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="fault_", ignore_cleanup_errors=True) as made:
        yield Path(made)


def _tail(folder: Path) -> str:
    """Return the last line that an attempt printed."""
    lines = (folder / "attempt.log").read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line for line in reversed(lines) if line.strip()), "without a word")
