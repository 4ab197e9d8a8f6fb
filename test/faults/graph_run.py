"""The runs that faults are injected into."""

import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..ros.short_handover import short_handover
from ..system.runs import Ended, Running
from .outcome import Kept, require
from .promises import whole
from .trial import Trial

EARLIEST = 200_000  # [byte] of the bag of a run that is under way
DOMAIN = re.compile(r"running on ROS domain (\d+),")

_LATEST = 900_000  # [byte] of the bag after some seconds
_STRETCH = 3.0  # [-] of the short handover: one second of simulated time


def under_way(trial: Trial) -> int:
    """Return a random size of the bag [byte] at which the fault comes."""
    return trial.random.randint(EARLIEST, _LATEST)


def domain_of(run: Running) -> int:
    """Return the domain that a run says it is on."""
    run.until(lambda: DOMAIN.search(run.text), "the domain of the run")
    said = DOMAIN.search(run.text)
    assert said
    return int(said[1])


@contextmanager
def held(run: Running, node: str) -> Iterator[None]:
    """Hold a run in lock step by stopping a node of its loop."""
    pid = run.nodes[node]
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def bag_of(trial: Trial) -> Path:
    """Return the bag of the run that is made as ``-o run``."""
    return trial.folder / "run" / "bag"


def short_run(trial: Trial) -> list[object]:
    """Return the command of a run of one second of simulated time."""
    schedule = trial.folder / "schedule.yaml"
    schedule.write_text(short_handover(stretch=_STRETCH), encoding="utf-8")
    return ["run", "--schedule", schedule, "-o", "run"]


def same_as_ever(trial: Trial, ended: Ended) -> Kept:
    """Require a whole bag with the bits of a run in one process; it may tell of events besides."""
    kept = whole(bag_of(trial), ended)
    again = trial.sms_handover("verify", "run")
    differences = [line for line in again.out.splitlines() if not line.startswith("run_events:")]
    require(again.code in (0, 1) and not again.errors, f"it cannot be reproduced: {again.errors}")
    require(again.code == 0 or not differences, f"the run is not reproduced: {differences[:3]}")
    return kept
