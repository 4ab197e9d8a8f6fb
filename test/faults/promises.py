"""Checks that many faults share; each raises PromiseBroken with what was seen instead."""

from pathlib import Path

from sms_handover.bag.info import read_info
from sms_handover.bag.ledger import Ledger
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError
from sms_handover.units import NS_PER_S

from ..system.runs import Ended
from .outcome import NOTHING_LOST, Kept, Loss, PromiseBroken, require
from .trial import Trial

_NS_PER_MS = 1e6
_LONGEST = 300  # characters of output that are quoted


def exit_code(ended: Ended, *allowed: int) -> None:
    """Require that a command ended with one of some exit codes."""
    require(ended.code in allowed, f"exit code {ended.code} instead of {allowed}: {_tail(ended)}")


def one_line(ended: Ended, *words: str) -> None:
    """Require a single line that tells an error, with all of some words, and no traceback."""
    require("Traceback" not in ended.err, f"a traceback: {_tail(ended)}")
    require(len(ended.errors) == 1, f"{len(ended.errors)} lines tell an error: {_tail(ended)}")
    missing = [word for word in words if word not in ended.errors[0]]
    require(not missing, f"the error does not say {missing}: {ended.errors[0]}")


def refused(ended: Ended, *words: str, code: int = 2) -> Kept:
    """Require one line with some words and an exit code, before anything was made."""
    exit_code(ended, code)
    one_line(ended, *words)
    return Kept(ended.code, NOTHING_LOST)


def whole(bag: Path, ended: Ended) -> Kept:
    """Require a command that succeeded and a complete bag."""
    exit_code(ended, 0)
    result = check(bag)
    require(result.complete, f"the bag is not complete: {result.findings[0].text if result.findings else ''}")
    return Kept(ended.code, ledger_loss(read_info(bag).ledger))


def closed(bag: Path, ended: Ended) -> Kept:
    """Return how a run ended whose bag was closed and has everything that came up to its end."""
    result = check(bag)
    require(not result.damaged, f"the bag is damaged: {result.findings[0].text if result.findings else ''}")
    return Kept(ended.code, ledger_loss(read_info(bag).ledger))


def readable(trial: Trial, bag: Path) -> Path:
    """Return a bag that can be read: the one given, or a recovery of it; its states have no gap."""
    try:
        run, path = read_run(bag), bag
    except BagError:
        path = trial.folder / f"recovered_{len(list(trial.folder.glob('recovered_*')))}"
        recover(bag, path)
        run = read_run(path)
    steps = {int(b - a) for a, b in zip(run.tick_ns, run.tick_ns[1:], strict=False)}
    require(len(steps) <= 1, f"the states have gaps: steps of {sorted(steps)} ns")
    require(len(run.tick_ns) > 0, "no state in the bag")
    return path


def lost_since(path: Path, published_ns: int, *, bound_ms: float) -> Loss:
    """Return how far a bag is behind the newest state published; requires that it is within a bound."""
    last_ns = int(read_run(path).tick_ns[-1])
    ms = max(0.0, (published_ns - last_ns) / _NS_PER_MS)
    require(ms <= bound_ms, f"{ms:g} ms lost at {published_ns / NS_PER_S:g} s, {bound_ms:g} ms are promised")
    return Loss(ms=ms)


def ledger_loss(ledger: Ledger | None) -> Loss:
    """Return what a ledger says is lost: messages published or expected that never came."""
    if ledger is None:
        return Loss()
    counts = [max(topic.missing, topic.lost or 0, 0) for topic in ledger.topics]
    gaps = [topic.largest_gap_ns - topic.period_ns for topic in ledger.topics if topic.missing]
    return Loss(sum(counts), max(gaps, default=0) / _NS_PER_MS)


def every_bag_is_usable(folder: Path, *, damaged: bool = False) -> None:
    """Require that every bag below a folder is whole, or that a recovery makes one of it that is.

    A bag that was ``damaged`` on purpose may have gaps; it must still be told in our own words. A file in
    which no record came to be is no bag; whether that may be is for the fault to say.
    """
    bags = {file.parent for file in folder.rglob("*.mcap")}
    for number, bag in enumerate(sorted(bags)):
        target = folder / f"usable_{number}"
        try:
            if not check(bag).damaged:
                continue
            recover(bag, target)
        except BagError:
            continue
        left = [f.text for f in check(target).findings if f.severity is Severity.DAMAGED]
        if left and not damaged:
            raise PromiseBroken(f"the recovery of {bag.relative_to(folder)} is damaged: {left[0]}")
        if not damaged:
            readable_states(target)


def readable_states(bag: Path) -> None:
    """Require that the ledger of a bag tells of no gap in its states."""
    ledger = read_info(bag).ledger
    gaps = [t.name for t in (ledger.topics if ledger else ()) if t.name == "/joint_states" and t.missing]
    require(not gaps, f"states are missing within {bag.name}")


def _tail(ended: Ended) -> str:
    """Return the end of what a command printed, in one line."""
    return " / ".join((ended.err or ended.out).split("\n"))[-_LONGEST:]
