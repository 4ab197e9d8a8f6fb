"""Networks between hosts that are slow, bad or cut: the graph split over hosts made of namespaces."""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from time import sleep

from ..system.hosts import Network, network, why_not
from ..system.runs import Ended, Running
from .fault import Fault
from .graph_run import short_run
from .outcome import CannotTry, Kept, require
from .promises import closed, exit_code, whole
from .trial import Trial

TITLE = "Networks between hosts"

_DOMAIN = 7  # of networks that nobody else is on
_TWO = ("plant,trajectory,ik,controller", "recorder")
_APART = ("plant,trajectory,ik", "controller,recorder")
_FOUR = ("plant,trajectory", "ik", "controller", "recorder")
_EARLIEST, _LATEST = 50_000, 600_000  # [byte] of the bag at which a link is cut; 0.85 MB are all
_SHORTEST_S, _LONGEST_S = 1.0, 6.0  # [s] of wall time for which it is
_MS = 1e-3  # [s]

Act = Callable[[Trial, Network, Sequence[Running]], None]


def split(nodes: Sequence[str], act: Act, options: Sequence[str], trial: Trial) -> tuple[Ended, ...]:
    """Run the graph with these nodes on as many hosts, the recorder on the last; return how each ended."""
    if reason := why_not():
        raise CannotTry(reason)
    with network(len(nodes), seed=trial.random.randrange(2**32)) as net, ExitStack() as stack:
        runs: list[Running] = []
        act(trial, net, runs)
        for host, names in zip(net.hosts, nodes, strict=True):
            peers = ",".join(other.address for other in net.hosts if other is not host)
            place = ("--nodes", names, "--peers", peers, "--domain-id", _DOMAIN, "-o", host.name)
            command = [*short_run(trial)[:-2], *place, *options]
            runs.append(stack.enter_context(trial.start(*command, prefix=host.command(trial.folder, []))))
        act(trial, net, runs)
        return tuple(trial.ended(run) for run in runs)


def bad(fault: Mapping[str, float], trial: Trial, net: Network, runs: Sequence[Running]) -> None:
    """Make every cable bad before the run begins."""
    if not runs:
        net.set(**fault)


def cut(which: Sequence[int], trial: Trial, net: Network, runs: Sequence[Running]) -> None:
    """Cut the cables of some hosts at a random moment of the run, for a random time."""
    if not runs:
        return
    bag = trial.folder / net.hosts[-1].name / "bag"
    runs[-1].until_recorded(bag, trial.random.randint(_EARLIEST, _LATEST))
    hosts = [net.hosts[index] for index in which]
    net.set(*hosts, cut=True)
    sleep(trial.random.uniform(_SHORTEST_S, _LONGEST_S))
    net.set(*hosts)


def cut_from_the_start(trial: Trial, net: Network, runs: Sequence[Running]) -> None:
    """Plug the hosts in only when their nodes already look for each other."""
    net.set(cut=True)
    if runs:
        sleep(trial.random.uniform(_SHORTEST_S, _LONGEST_S))
        net.set()


def cut_for_good(trial: Trial, net: Network, runs: Sequence[Running]) -> None:
    """Cut the cable of the recorder's host and leave it."""
    if runs:
        bag = trial.folder / net.hosts[-1].name / "bag"
        runs[-1].until_recorded(bag, trial.random.randint(_EARLIEST, _LATEST))
        net.set(net.hosts[-1], cut=True)


def same_bits(trial: Trial, seen: Sequence[Ended]) -> Kept:
    """Require that every command succeeded, and a whole bag with the bits of a run in one process."""
    folder = f"host{len(seen)}"
    for ended in seen:
        exit_code(ended, 0)
    again = trial.sms_handover("verify", folder)
    require(again.code == 0, f"not the same bits: {(again.out + again.err).splitlines()[:2]}")
    return whole(trial.folder / folder / "bag", seen[-1])


def told_and_whole(trial: Trial, seen: Sequence[Ended]) -> Kept:
    """Require a whole bag of a run in real time that says that nearly every command came late."""
    exit_code(seen[0], 0)
    told = re.search(r"of (\d+) ticks .* (\d+) held an old command", seen[0].out)
    require(told, "no word of the commands that were held")
    require(told and int(told[2]) > 0.9 * int(told[1]), f"it says {told and told[0]}")
    return whole(trial.folder / f"host{len(seen)}" / "bag", seen[-1])


def gives_up(trial: Trial, seen: Sequence[Ended]) -> Kept:
    """Require that every command ended with 1 and says why, and that the bag was closed."""
    for ended in seen:
        exit_code(ended, 1)
        told = "error: no progress" in ended.err or "nothing has come on" in ended.err
        require(told and "Traceback" not in ended.err, f"no reason told: {ended.err[-200:]}")
    return closed(trial.folder / f"host{len(seen)}" / "bag", seen[-1])


def _bad(name: str, words: str, nodes: Sequence[str] = _APART, **fault: float) -> Fault[tuple[Ended, ...]]:
    """Return a fault of every cable during a whole run in lock step."""
    return Fault(
        name=name,
        injected=f"{words}, on every cable of {len(nodes)} hosts",
        promise="every command succeeds, the bag is whole, its bits are those of a run in one process",
        inject=partial(split, nodes, partial(bad, fault), ()),
        check=same_bits,
        seeded=True,
        timeout_s=600.0,
    )


def _cut(name: str, words: str, nodes: Sequence[str], which: Sequence[int]) -> Fault[tuple[Ended, ...]]:
    """Return a cut at a random moment of a run in lock step."""
    return Fault(
        name=name,
        injected=f"{words} cut at a random moment for 1 to 6 s, {len(nodes)} hosts",
        promise="the run goes on where it was; the bag is whole, its bits are those of a run in one process",
        inject=partial(split, nodes, partial(cut, which), ()),
        check=same_bits,
        seeded=True,
        timeout_s=600.0,
    )


FAULTS = (
    _bad("delay", "5 ms of delay", delay=5 * _MS),
    _bad("jitter", "1 to 5 ms of delay", delay=1 * _MS, jitter=4 * _MS),
    _bad("loss", "2 % of the packets lost", loss=0.02),
    _bad("heavy-loss", "10 % of the packets lost", loss=0.1),
    _bad("reordered", "a quarter of the packets overtake the others", delay=1 * _MS, reorder=0.25),
    _bad("duplicated", "a third of the packets come twice", duplicate=0.33),
    _bad("corrupted", "a bit flipped in 2 % of the packets", corrupt=0.02),
    _bad("slow-link", "20 Mbit/s", rate=20e6),
    _bad(
        "all-at-once",
        "delay, jitter, loss, reordering, duplicates, flipped bits",
        _FOUR,
        delay=1 * _MS,
        jitter=2 * _MS,
        loss=0.02,
        reorder=0.2,
        duplicate=0.05,
        corrupt=0.02,
    ),
    _cut("cut-two-hosts", "the link", _APART, (0, 1)),
    _cut("cut-recorder", "the cable of the recorder's host", _TWO, (1,)),
    _cut("cut-four-hosts", "every cable", _FOUR, (0, 1, 2, 3)),
    _cut("cut-one-of-four", "the cable of the controller's host", _FOUR, (2,)),
    Fault(
        name="cut-from-the-start",
        injected="hosts plugged in 1 to 6 s after their commands were started",
        promise="the run begins then; the bag is whole, its bits are those of a run in one process",
        inject=partial(split, _APART, cut_from_the_start, ()),
        check=same_bits,
        seeded=True,
        timeout_s=600.0,
    ),
    Fault(
        name="cut-for-good",
        injected="the cable of the recorder's host cut at a random moment and left",
        promise="every command ends with 1 and says why, the bag is closed with all that came",
        inject=partial(split, _TWO, cut_for_good, ()),
        check=gives_up,
        seeded=True,
        timeout_s=600.0,
    ),
    Fault(
        name="real-time-delay",
        injected="3 ms of delay on every cable between controller and plant, in real time",
        promise="exit code 0, the last line tells the ticks that held an old command, the bag is whole",
        inject=partial(split, _APART, partial(bad, {"delay": 3 * _MS}), ("--real-time",)),
        check=told_and_whole,
        timeout_s=600.0,
    ),
)
