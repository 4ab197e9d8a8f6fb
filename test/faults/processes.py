"""Processes that die: killed, ended or stopped at a random moment of a run."""

import os
import re
import signal
from collections.abc import Callable
from functools import partial

from benchmarks.recorder_kill import Witness
from sms_handover.topics import NODES, RECORDER

from ..system.runs import Ended, Running
from .fault import Fault
from .outcome import Kept, require
from .promises import closed, exit_code, lost_since, one_line, readable
from .trial import Trial

TITLE = "Processes that die"

_KILLED = (name for name in NODES if name != RECORDER)
_EARLIEST, _LATEST = 200_000, 900_000  # [byte] of the bag at which a process is killed: within some seconds
_DOMAIN = re.compile(r"running on ROS domain (\d+),")
_BOUND_MS = 50.0  # [ms] that a killed recorder may lose in lock step


def domain_of(run: Running) -> int:
    """Return the domain that a run says it is on."""
    run.until(lambda: _DOMAIN.search(run.text), "the domain of the run")
    said = _DOMAIN.search(run.text)
    assert said
    return int(said[1])


def under_way(trial: Trial) -> int:
    """Return a random size of the bag [byte] at which the fault comes."""
    return trial.random.randint(_EARLIEST, _LATEST)


def kill(node: str, number: signal.Signals, trial: Trial) -> Ended:
    """Send a signal to one node of a run."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(trial.folder / "run" / "bag", under_way(trial))
        os.kill(run.nodes[node], number)
        return trial.ended(run)


def is_named(node: str, trial: Trial, ended: Ended) -> Kept:
    """Require exit code 1, the name of who died, and a bag that was closed with all that had come."""
    exit_code(ended, 1)
    one_line(ended, f"node '{node}' was killed by signal 9")
    return closed(trial.folder / "run" / "bag", ended)


def kill_launcher(trial: Trial) -> Ended:
    """Kill the launcher, which then cannot end its nodes."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(trial.folder / "run" / "bag", under_way(trial))
        run.send(signal.SIGKILL)
        return trial.ended(run)


def nodes_end(trial: Trial, ended: Ended) -> Kept:
    """Require a bag that the recorder has closed; that no node is left is required of every fault."""
    require(ended.code == -signal.SIGKILL, f"the launcher ended with {ended.code}")
    for pid in list(trial.remaining()):
        trial.wait_for(pid)
    return closed(trial.folder / "run" / "bag", ended)


def interrupt(number: signal.Signals, trial: Trial) -> Ended:
    """Send a signal to the launcher."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(trial.folder / "run" / "bag", under_way(trial))
        run.send(number)
        return trial.ended(run)


def ends_in_order(trial: Trial, ended: Ended) -> Kept:
    """Require exit code 130 and a closed bag."""
    exit_code(ended, 130)
    require("Traceback" not in ended.err, "a traceback")
    return closed(trial.folder / "run" / "bag", ended)


def kill_recorder(trial: Trial) -> tuple[Ended, int]:
    """Kill the recorder; return how the run ended and the newest state [ns] that had been published."""
    with trial.start("run", "-o", "run") as run:
        witness = Witness(domain_of(run))
        try:
            size, bag = under_way(trial), trial.folder / "run" / "bag" / "bag_0.mcap"
            run.until(lambda: witness.newest_ns() > 0 and bag.stat().st_size > size, "the moment of the kill")
            os.kill(run.nodes[RECORDER], signal.SIGKILL)
            ended = trial.ended(run)
            return ended, witness.newest_ns()
        finally:
            witness.close()


def loses_little(trial: Trial, seen: tuple[Ended, int]) -> Kept:
    """Require that what a recovery brings back is at most so far behind what had been published."""
    ended, published_ns = seen
    exit_code(ended, 1)
    one_line(ended, "node 'recorder' was killed by signal 9")
    path = readable(trial, trial.folder / "run" / "bag")
    return Kept(ended.code, lost_since(path, published_ns, bound_ms=_BOUND_MS))


def _kills() -> list[Fault[Ended]]:
    """Return a fault for every node but the recorder, which promises something else."""
    return [
        Fault(
            name=f"{node}-killed",
            injected=f"SIGKILL of `{node}` at a random moment",
            promise="exit code 1, it is named, no process is left, the bag is closed",
            inject=partial(kill, node, signal.SIGKILL),
            check=partial(is_named, node),
            seeded=True,
        )
        for node in _KILLED
    ]


_IN_ORDER: Callable[[Trial, Ended], Kept] = ends_in_order

FAULTS = (
    *_kills(),
    Fault(
        name="recorder-killed",
        injected="SIGKILL of `recorder` at a random moment",
        promise="exit code 1, it is named; `bag recover` makes a bag without a gap, at most 50 ms behind",
        inject=kill_recorder,
        check=loses_little,
        seeded=True,
    ),
    Fault(
        name="launcher-killed",
        injected="SIGKILL of the launcher at a random moment",
        promise="its nodes notice and end, the bag is closed",
        inject=kill_launcher,
        check=nodes_end,
        seeded=True,
    ),
    *(
        Fault(
            name=f"launcher-{number.name.lower()}",
            injected=f"{number.name} to the launcher at a random moment",
            promise="exit code 130, the bag is closed with all that was published",
            inject=partial(interrupt, number),
            check=_IN_ORDER,
            seeded=True,
        )
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    ),
)
