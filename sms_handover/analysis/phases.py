"""The phases of a run as spans of time and of rows."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sms_handover.run_data import RunData
from sms_handover.types import TaskPhase
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True)
class PhaseSpan:
    """One phase, from its start to the start of the next one or the end of the run.

    ``rows`` are the reference periods with this phase's targets. ``states`` are the ticks from
    start to end, both included, because the state has no jump there; ``efforts`` are the ticks
    over which this phase's efforts acted: those that end after the start and not after the end.
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
        """Length in s."""
        return ns_to_seconds(self.end_ns - self.start_ns)


def phase_spans(run: RunData) -> tuple[PhaseSpan, ...]:
    """Return the phases of a run in the order of time; entries before the first phase belong to none."""
    entered = [
        phase
        for before, phase in zip((None, *run.phases), run.phases, strict=False)
        if before is None or before.index != phase.index
    ]
    last_ns = max([int(stamps[-1]) for stamps in (run.tick_ns, run.reference_ns) if len(stamps)], default=0)
    starts = [phase.stamp_ns for phase in entered]
    return tuple(
        _span(run, phase, end_ns, is_last=phase is entered[-1])
        for phase, end_ns in zip(entered, [*starts[1:], last_ns], strict=False)
    )


def _span(run: RunData, phase: TaskPhase, end_ns: int, *, is_last: bool) -> PhaseSpan:
    """Return the span of a phase with its rows and ticks looked up."""
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
