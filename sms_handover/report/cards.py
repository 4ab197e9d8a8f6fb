"""Cards at the head of a report, one per run."""

from dataclasses import dataclass

from sms_handover.analysis.completion import Completion
from sms_handover.analysis.highlights import succeeded
from sms_handover.bag.ledger import Ledger, ledger_table
from sms_handover.graph.events import graver_in_words
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.report.styles import RunStyle
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True)
class Verdict:
    """A short statement, and whether it is good; None if that is unknown."""

    text: str
    good: bool | None


@dataclass(frozen=True)
class RunCard:
    """One run: its style, its duration in s, its start, and its verdicts."""

    style: RunStyle
    duration: float
    started: str
    messages: int
    verdicts: tuple[Verdict, ...]
    ledger: str


def run_card(run: RecordedRun, style: RunStyle, completion: Completion) -> RunCard:
    """Return the card of a run, with whether it is complete, and the loss ledger as text."""
    ticks, ledger = run.data.tick_ns, run.info.ledger
    return RunCard(
        style=style,
        duration=ns_to_seconds(int(ticks[-1] - ticks[0])) if len(ticks) else 0.0,
        started=run.info.provenance.get("start", ""),
        messages=run.info.message_count,
        verdicts=(
            _completion(completion),
            _grasps(run),
            *_decisions(run),
            _recording(ledger),
            *_second_engine(run),
        ),
        ledger="" if ledger is None else ledger_table(ledger),
    )


def _completion(found: Completion) -> Verdict:
    """Return whether the run did its task; the worst that it lacks stands first."""
    if found.complete:
        known = "" if found.clearance_known else ", but nothing is known of collisions"
        return Verdict(f"task complete{known}", True if found.clearance_known else None)
    first, *others = found.shortfalls
    more = f", and {len(others)} more" if others else ""
    return Verdict(f"task not complete: {first}{more}", good=False)


def _grasps(run: RecordedRun) -> Verdict:
    count, total = succeeded(run.data.grasp_events)
    if not total:
        return Verdict("no grasp command recorded", None)
    return Verdict(f"{count} of {total} grasp commands succeeded", count == total)


def _decisions(run: RecordedRun) -> tuple[Verdict, ...]:
    """Return the number of warnings and errors that the nodes reported, if there were any."""
    words = graver_in_words(run.data.run_events)
    return (Verdict(words, good=False),) if words else ()


def _second_engine(run: RecordedRun) -> tuple[Verdict, ...]:
    """Return what another engine says of the run, if one was asked."""
    found = run.second_engine
    return () if found is None else (Verdict(found.sentence(), None if found.unsupported else found.agrees),)


def _recording(ledger: Ledger | None) -> Verdict:
    """Return how many messages are known to be missing."""
    if ledger is None:
        return Verdict("recorded without a loss ledger", None)
    lost = sum(max(topic.missing, topic.lost or 0) for topic in ledger.topics)
    return Verdict("no message missing" if ledger.complete else f"{lost} messages missing", ledger.complete)
