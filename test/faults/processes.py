"""Processes that die: killed or ended at a random moment of a run."""

import os
import signal
from collections.abc import Callable, Iterable
from functools import partial
from time import sleep

from benchmarks.recorder_kill import Witness
from sms_handover.graph.topics import NODES, RECORDER

from ..system.runs import Ended, is_node
from .fault import Fault
from .graph_run import EARLIEST, bag_of, domain_of, short_run, under_way
from .leftovers import SHARED_MEMORY
from .outcome import Kept, require
from .promises import closed, exit_code, lost_since, one_line, readable, whole
from .trial import Trial

TITLE = "Processes that die"

_KILLED = (name for name in NODES if name != RECORDER)
_BOUND_MS = 50.0  # [ms] that a killed recorder may lose in lock step
# Sizes of the bag [byte] in a short run between which a moment is: none for its start, at its end 0.85 MB.
_MOMENTS = (None, (0, 1.0e5), (1.0e5, 7.0e5), (7.0e5, 8.2e5))
_SOON_S = 1.0  # [s] of wall time at most after that
_LOOK_S = 0.01  # [s] of wall time between two looks at the bag
_LAUNCHER = "launcher"


def kill(node: str, number: signal.Signals, trial: Trial) -> Ended:
    """Send a signal to one node of a run."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        os.kill(run.nodes[node], number)
        return trial.ended(run)


def is_named(node: str, number: signal.Signals, trial: Trial, ended: Ended) -> Kept:
    """Require exit code 1, the name of who died, and a bag that was closed with all that had come."""
    exit_code(ended, 1)
    one_line(ended, f"node '{node}' was killed by signal {number.value} ({number.name})")
    return closed(bag_of(trial), ended)


def kill_launcher(trial: Trial) -> Ended:
    """Kill the launcher, which then cannot end its nodes."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        run.send(signal.SIGKILL)
        return trial.ended(run)


def nodes_end(trial: Trial, ended: Ended) -> Kept:
    """Require a bag that the recorder has closed; that no node is left is required of every fault."""
    require(ended.code == -signal.SIGKILL, f"the launcher ended with {ended.code}")
    for pid in list(trial.remaining()):
        trial.wait_for(pid)
    return closed(bag_of(trial), ended)


def interrupt(number: signal.Signals, trial: Trial) -> Ended:
    """Send a signal to the launcher."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        run.send(number)
        return trial.ended(run)


def ends_in_order(trial: Trial, ended: Ended) -> Kept:
    """Require exit code 130 and a closed bag."""
    exit_code(ended, 130)
    require("Traceback" not in ended.err, "a traceback")
    return closed(bag_of(trial), ended)


def kill_recorder(trial: Trial) -> tuple[Ended, int]:
    """Kill the recorder; return how the run ended and the newest state [ns] that had been published."""
    with trial.start("run", "-o", "run") as run:
        witness = Witness(domain_of(run))
        try:
            size, bag = under_way(trial), bag_of(trial) / "bag_0.mcap"
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
    path = readable(trial, bag_of(trial))
    return Kept(ended.code, lost_since(path, published_ns, bound_ms=_BOUND_MS))


def at_any_moment(victim: str, number: signal.Signals, trial: Trial) -> Ended:
    """Send a signal to a process of a short run: while it starts, in the middle, or about its end."""
    with trial.start(*short_run(trial)) as run:
        run.until_all_nodes(NODES)
        pid = run.pid if victim == _LAUNCHER else run.nodes[victim]
        moment = trial.random.choice(_MOMENTS)
        if moment:
            file, size = bag_of(trial) / "bag_0.mcap", trial.random.uniform(*moment)
            while run.process.poll() is None and not (file.is_file() and file.stat().st_size > size):
                sleep(_LOOK_S)
        sleep(trial.random.uniform(0.0, _SOON_S))
        if run.process.poll() is None and (victim == _LAUNCHER or is_node(pid)):
            os.kill(pid, number)
        return trial.ended(run)


def named_or_done(victim: str, trial: Trial, ended: Ended) -> Kept:
    """Require that a run is whole, or fails with the name of who died and a bag that is closed or none."""
    if ended.code == 0:
        return whole(bag_of(trial), ended)
    exit_code(ended, 1)
    one_line(ended, f"node '{victim}' ")
    return _what_there_is(trial, ended)


def ended_or_done(number: signal.Signals, trial: Trial, ended: Ended) -> Kept:
    """Require that a launcher ended in order or was killed, and a bag that is closed, or none.

    Behind its last words, while the interpreter exits, a signal does what it does to any program.
    """
    over = "run complete" in ended.out
    exit_code(ended, 0, 130, -signal.SIGKILL, *([-number] if over else []))
    for pid in list(trial.remaining()):
        trial.wait_for(pid)
    return _what_there_is(trial, ended)


def _what_there_is(trial: Trial, ended: Ended) -> Kept:
    """Return what is lost in the bag, if one was begun; where its recorder was killed, it is recovered."""
    recorded = [file for file in bag_of(trial).glob("*.mcap") if file.stat().st_size > EARLIEST]
    if not recorded:
        return Kept(ended.code, note="it came before anything was recorded")
    if "node 'recorder' was killed" in ended.err:
        require("'sms-handover bag recover " in ended.err, "the message does not say how to recover the bag")
        readable(trial, bag_of(trial))
        return Kept(ended.code)
    return closed(bag_of(trial), ended)


def kill_launcher_unreaped(trial: Trial) -> Ended:
    """Kill the launcher, whose parent does not take notice: it stays as a zombie."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        nodes = run.nodes
        os.kill(run.pid, signal.SIGKILL)
        for pid in nodes.values():
            trial.wait_for(pid)
        return trial.ended(run)


def kill_all(trial: Trial) -> Ended:
    """Kill the launcher and every node at once, as when memory runs out or a container is removed."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        for pid in (run.pid, *run.nodes.values()):
            os.kill(pid, signal.SIGKILL)
        return trial.ended(run)


def nothing_is_left(trial: Trial, ended: Ended) -> Kept:
    """Require a bag that can be recovered, and that the next run works and clears the shared memory."""
    require(ended.code == -signal.SIGKILL, f"the launcher ended with {ended.code}")
    readable(trial, bag_of(trial))
    left = _segments()
    again = trial.sms_handover(*short_run(trial)[:-1], "again")
    kept = whole(trial.folder / "again" / "bag", again)
    if not trial.own_mounts:
        return Kept(ended.code, note="shared memory is that of the whole machine here: not looked at")
    require(left, "the killed processes left no segment: the fault was none")
    require(not _segments(), f"left in shared memory: {_segments()}")
    return Kept(ended.code, kept.lost, note=f"{len(left)} segments left, cleared by the next run")


def _segments() -> list[str]:
    """Return what Fast DDS or a run has left in shared memory."""
    names = [file.name for file in SHARED_MEMORY.iterdir()]
    return sorted(name for name in names if name.startswith(("fastrtps_", "sem.fastrtps_", "sms_handover_")))


def kill_and_look(trial: Trial) -> Ended:
    """Kill two nodes of a run at once."""
    with trial.start("run", "-o", "run") as run:
        run.until_recorded(bag_of(trial), under_way(trial))
        for node in ("controller", "trajectory"):
            os.kill(run.nodes[node], signal.SIGKILL)
        return trial.ended(run)


def clears_what_they_left(trial: Trial, ended: Ended) -> Kept:
    """Require both names or at least one, a closed bag, and clean shared memory at the end of the run."""
    exit_code(ended, 1)
    one_line(ended, "was killed by signal 9 (SIGKILL)")
    require(not trial.own_mounts or not _segments(), f"left in shared memory: {_segments()}")
    return closed(bag_of(trial), ended)


def hang_up_ignored(trial: Trial) -> Ended:
    """Send SIGHUP to a run under nohup(1)."""
    with trial.start(*short_run(trial), prefix=("nohup",)) as run:
        run.until_recorded(bag_of(trial), EARLIEST)
        run.send(signal.SIGHUP)
        return trial.ended(run)


def goes_on(trial: Trial, ended: Ended) -> Kept:
    """Require a whole bag."""
    return whole(bag_of(trial), ended)


def _kills(nodes: Iterable[str], number: signal.Signals) -> list[Fault[Ended]]:
    """Return a fault for each of some nodes but the recorder, which promises something else."""
    return [
        Fault(
            name=f"{node}-killed" if number == signal.SIGKILL else f"{node}-{number.name.lower()}",
            injected=f"{number.name} of `{node}` at a random moment",
            promise="exit code 1, it is named with the signal, no process is left, the bag is closed",
            inject=partial(kill, node, number),
            check=partial(is_named, node, number),
            seeded=True,
        )
        for node in nodes
    ]


def _at_any_moment() -> list[Fault[Ended]]:
    """Return a fault for each process: the moment may be before the match, the end, or while it drains."""
    nodes = [
        Fault(
            name=f"{node}-killed-any-time",
            injected=f"SIGKILL of `{node}` at any moment of a short run, its start and end included",
            promise="a whole run, or exit code 1 and its name; a bag that opens, for the recorder after the "
            "command that the message says",
            inject=partial(at_any_moment, node, signal.SIGKILL),
            check=partial(named_or_done, node),
            seeded=True,
        )
        for node in NODES
    ]
    launcher = [
        Fault(
            name=f"launcher-{number.name.lower()}-any-time",
            injected=f"{number.name} to the launcher at any moment of a short run",
            promise="no process is left, a bag opens if one was begun, exit code 0 only if the run was over",
            inject=partial(at_any_moment, _LAUNCHER, number),
            check=partial(ended_or_done, number),
            seeded=True,
        )
        for number in (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    ]
    return nodes + launcher


_IN_ORDER: Callable[[Trial, Ended], Kept] = ends_in_order

FAULTS = (
    *_kills(_KILLED, signal.SIGKILL),
    *_kills(("plant",), signal.SIGSEGV),
    *_kills(("controller",), signal.SIGABRT),
    Fault(
        name="recorder-killed",
        injected="SIGKILL of `recorder` at a random moment",
        promise="exit code 1, it is named; `bag recover` makes a bag without a gap, at most 50 ms behind",
        inject=kill_recorder,
        check=loses_little,
        seeded=True,
    ),
    Fault(
        name="two-nodes-killed",
        injected="SIGKILL of `controller` and `trajectory` at once, at a random moment",
        promise="exit code 1, named, the bag is closed, nothing of theirs stays in shared memory",
        inject=kill_and_look,
        check=clears_what_they_left,
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
    Fault(
        name="launcher-zombie",
        injected="SIGKILL of the launcher, which its parent does not reap",
        promise="its nodes notice and end all the same, the bag is closed",
        inject=kill_launcher_unreaped,
        check=nodes_end,
        seeded=True,
    ),
    Fault(
        name="all-killed",
        injected="SIGKILL of the launcher and every node at once",
        promise="`bag recover` makes a bag without a gap; the next run works and clears the shared memory",
        inject=kill_all,
        check=nothing_is_left,
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
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    ),
    *_at_any_moment(),
    Fault(
        name="hang-up-ignored",
        injected="SIGHUP to a run under nohup(1)",
        promise="the run goes on and is whole",
        inject=hang_up_ignored,
        check=goes_on,
    ),
)
