"""Phases of a run as spans of time and of rows."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sms_handover.graph.events import GRASP_FAILED
from sms_handover.run_data import RunData
from sms_handover.types import TaskPhase
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True)
class PhaseSpan:
    """One phase, from its start to the start of the next one or the end of the run.

    A retried phase is another one, and so is the rest of one that has failed; ``name`` distinguishes
    them. The first attempt that was not given up for a missed grasp has the plain name.

    ``rows`` are the reference periods with this phase's targets. ``states`` are the ticks from start to
    end, both included, because the state is continuous there; ``efforts`` are the ticks over which this
    phase's efforts acted: those that end after the start and not after the end.
    """

    index: int
    name: str
    start_ns: int
    end_ns: int
    rows: slice
    states: slice
    efforts: slice

    @property
    def duration(self) -> float:
        """Duration in s."""
        return ns_to_seconds(self.end_ns - self.start_ns)


def phase_spans(run: RunData) -> tuple[PhaseSpan, ...]:
    """Return the phases of a run in the order of time; rows before the first phase belong to none."""
    entered = [
        phase
        for before, phase in zip((None, *run.phases), run.phases, strict=False)
        if before is None or before.entry != phase.entry
    ]
    last_ns = max([int(stamps[-1]) for stamps in (run.tick_ns, run.reference_ns) if len(stamps)], default=0)
    starts = [phase.stamp_ns for phase in entered]
    names = _names(entered, {e.stamp_ns for e in run.run_events if e.kind == GRASP_FAILED})
    return tuple(
        _span(run, replace(phase, name=name), end_ns, is_last=phase is entered[-1])
        for phase, name, end_ns in zip(entered, names, [*starts[1:], last_ns], strict=False)
    )


def _names(entered: Sequence[TaskPhase], aborted_ns: Collection[int]) -> Iterator[str]:
    """Yield a unique name for each phase, in the order of time.

    A phase was given up for a missed grasp if an earlier one followed, or if it failed at ``aborted_ns``.
    """
    taken: set[str] = set()
    for phase, following in zip(entered, (*entered[1:], None), strict=False):
        if phase.failed:
            yield f"{phase.name} (failed)"
        elif following and (following.index < phase.index or following.stamp_ns in aborted_ns):
            yield f"{phase.name} (missed, attempt {phase.attempt})"
        elif phase.name in taken:
            yield f"{phase.name} (attempt {phase.attempt})"
        else:
            taken.add(phase.name)
            yield phase.name


def _span(run: RunData, phase: TaskPhase, end_ns: int, *, is_last: bool) -> PhaseSpan:
    start_ns = phase.stamp_ns
    # the row at the end already has the targets of the next phase, if there is one
    row_side: Literal["left", "right"] = "right" if is_last else "left"
    rows = slice(
        int(np.searchsorted(run.reference_ns, start_ns)),
        int(np.searchsorted(run.reference_ns, end_ns, row_side)),
    )
    last = int(np.searchsorted(run.tick_ns, end_ns, "right"))
    states = slice(int(np.searchsorted(run.tick_ns, start_ns)), last)
    efforts = slice(int(np.searchsorted(run.tick_ns, start_ns, "right")), last)
    return PhaseSpan(phase.index, phase.name, start_ns, end_ns, rows, states, efforts)
