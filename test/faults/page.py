"""docs/reliability.md: every fault that was tried, what was promised, and what came of it."""

from collections import Counter
from collections.abc import Iterable, Sequence

from benchmarks.machine import machine
from benchmarks.results import Table

from .fault import Family
from .outcome import Outcome, Status

_HEADING = ("fault", "injected", "promise", "kept", "data lost", "exit code")
_LONGEST = 200  # characters of a reason in a cell


def page(families: Sequence[Family], outcomes: Sequence[Outcome], seed: int) -> str:
    """Return the page as Markdown."""
    by_name = {outcome.fault: outcome for outcome in outcomes}
    count = Counter(outcome.status for outcome in outcomes)
    parts = [
        "# Reliability",
        "This page is written by `make faults`, which injects every fault below and checks what is promised "
        "for it. After each it also checks that no process is left and that every bag is whole or can be "
        "recovered. [`test/faults`](../test/faults/fault.py) tells how a fault is added, "
        "`python test/faults --help` how to try some alone.",
        f"**{len(outcomes)} faults: {count[Status.KEPT]} promises kept, {count[Status.BROKEN]} broken, "
        f"{count[Status.NOT_TRIED]} could not be tried on this machine.**"
        f"{_not_tried(families, len(outcomes))} "
        f"{_losses(outcomes)}",
        "\n".join(f"- {line}" for line in (*machine(), f"Seed: {seed}")),
        "*Data lost* is against what had been published: messages, and simulated time in ms; `-` where the "
        "fault has no data to lose, or nobody knows how much was published.",
    ]
    for family in families:
        rows = [
            _row(fault.name, fault.injected, fault.promise, by_name[f"{family.name}/{fault.name}"])
            for fault in family.faults
            if f"{family.name}/{fault.name}" in by_name
        ]
        if rows:
            parts += [f"## {family.title}", Table(_HEADING, rows).markdown()]
        notes = [by_name.get(f"{family.name}/{fault.name}") for fault in family.faults]
        told = [f"- `{o.fault.partition('/')[2]}`: {o.note}" for o in notes if o and o.note]
        if told:
            parts.append("\n".join(told))
    return "\n\n".join(parts) + "\n"


def _row(name: str, injected: str, promise: str, outcome: Outcome) -> tuple[str, ...]:
    """Return the cells of one fault."""
    verdict = {Status.KEPT: "yes", Status.BROKEN: "**NO**", Status.NOT_TRIED: "not tried"}[outcome.status]
    if outcome.reason:
        verdict += f": {outcome.reason[:_LONGEST]}"
    code = "-" if outcome.exit_code is None else str(outcome.exit_code)
    return f"`{name}`", injected, promise, verdict, str(outcome.lost), code


def _losses(outcomes: Iterable[Outcome]) -> str:
    """Return the largest losses, and what was left in shared memory, in sentences."""
    kept = [outcome for outcome in outcomes if outcome.status is Status.KEPT]
    nothing = sum(str(outcome.lost) == "nothing" for outcome in kept)
    worst_ms = max((outcome.lost.ms for outcome in kept if outcome.lost.ms is not None), default=0.0)
    told = f"Nothing was lost in {nothing} of them, at most {worst_ms:g} ms of simulated time in the others"
    if any(outcome.lost.messages for outcome in kept):
        told += "; bags that were damaged on purpose lost what the damage had hit"
    left = max((outcome.shared_memory or 0 for outcome in outcomes), default=0)
    return f"{told}. At most {left / 2**20:.1f} MiB were left in shared memory, by what was killed."


def _not_tried(families: Sequence[Family], tried: int) -> str:
    """Return how many faults this run has left out, '' if none."""
    left_out = sum(len(family.faults) for family in families) - tried
    return f" {left_out} more were left out of this run." if left_out else ""
