"""Processes that are suspended: they live, and do nothing."""

import os
import signal
from functools import partial
from time import sleep

from sms_handover.graph.topics import NODES, RECORDER

from ..system.runs import Ended
from .fault import Fault
from .graph_run import EARLIEST, bag_of, same_as_ever, short_run, under_way
from .outcome import Kept
from .processes import nodes_end
from .promises import closed, exit_code, one_line
from .trial import Trial

TITLE = "Processes that are suspended"

_LONGER_THAN_PATIENCE_S = 35.0  # [s] of wall time; the launcher has 30 s for a graph that stands still


def suspend(node: str, trial: Trial) -> Ended:
    """Stop a node until the launcher says so, then let it go on."""
    with trial.start(*short_run(trial)) as run:
        run.until_recorded(bag_of(trial), EARLIEST)
        pid = run.nodes[node]
        os.kill(pid, signal.SIGSTOP)
        run.until(lambda: f"node '{node}' is suspended" in run.text, "the news that it is suspended")
        os.kill(pid, signal.SIGCONT)
        return trial.ended(run)


def suspend_for_ever(node: str, trial: Trial) -> Ended:
    """Stop a node and leave it."""
    with trial.start(*short_run(trial)) as run:
        run.until_recorded(bag_of(trial), EARLIEST)
        os.kill(run.nodes[node], signal.SIGSTOP)
        return trial.ended(run)


def is_given_up(node: str, trial: Trial, ended: Ended) -> Kept:
    """Require exit code 1, the name of who is suspended, and a closed bag."""
    exit_code(ended, 1)
    one_line(ended, f"node '{node}' has been suspended for 20 s")
    return closed(bag_of(trial), ended)


def suspend_launcher(trial: Trial) -> Ended:
    """Stop the launcher for longer than it has patience with others, as Ctrl-Z does."""
    with trial.start(*short_run(trial)) as run:
        run.until_recorded(bag_of(trial), EARLIEST)
        run.send(signal.SIGSTOP)
        sleep(_LONGER_THAN_PATIENCE_S)
        run.send(signal.SIGCONT)
        return trial.ended(run)


def kill_launcher_of_suspended(node: str, trial: Trial) -> Ended:
    """Kill the launcher while a node is stopped, whom nobody is left to wake."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        os.kill(run.nodes[node], signal.SIGSTOP)
        run.send(signal.SIGKILL)
        return trial.ended(run)


def _suspended() -> list[Fault[Ended]]:
    """Return a fault for each node."""
    return [
        Fault(
            name=f"{node}-suspended",
            injected=f"SIGSTOP of `{node}`, SIGCONT when the launcher has told of it",
            promise="named after 5 s; then the run is whole, bit for bit as without",
            inject=partial(suspend, node),
            check=same_as_ever,
        )
        for node in NODES
    ]


FAULTS = (
    *_suspended(),
    Fault(
        name="controller-suspended-for-ever",
        injected="SIGSTOP of `controller`, and nobody lets it go on",
        promise="given up after 20 s with exit code 1 and its name; no process is left, the bag is closed",
        inject=partial(suspend_for_ever, "controller"),
        check=partial(is_given_up, "controller"),
    ),
    Fault(
        name="launcher-suspended",
        injected="SIGSTOP of the launcher for 35 s, as by Ctrl-Z, then SIGCONT",
        promise="the graph goes on meanwhile, the launcher does not take its own absence for a stall",
        inject=suspend_launcher,
        check=same_as_ever,
    ),
    *(
        Fault(
            name=f"launcher-killed-{node}-suspended",
            injected=f"SIGKILL of the launcher while `{node}` is suspended by SIGSTOP",
            promise="it wakes and ends as the others do, the bag is closed",
            inject=partial(kill_launcher_of_suspended, node),
            check=nodes_end,
            seeded=True,
        )
        for node in ("controller", RECORDER)
    ),
)
