"""The phases of a run as spans of time and of rows."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sms_handover.run_data import RunData
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
    ends = [*(phase.stamp_ns for phase in entered[1:]), last_ns]
    return tuple(
        _span(run, phase.index, phase.name, (phase.stamp_ns, end_ns), is_last=place == len(entered) - 1)
        for place, (phase, end_ns) in enumerate(zip(entered, ends, strict=True))
    )


def _span(run: RunData, index: int, name: str, time_ns: tuple[int, int], *, is_last: bool) -> PhaseSpan:
    """Return the span of a phase with its rows and ticks looked up."""
    start_ns, end_ns = time_ns
    row_side: Literal["left", "right"] = (
        "right" if is_last else "left"
    )  # the row at the end has the targets of the next phase
    rows = slice(
        int(np.searchsorted(run.reference_ns, start_ns)),
        int(np.searchsorted(run.reference_ns, end_ns, row_side)),
    )
    last = int(np.searchsorted(run.tick_ns, end_ns, "right"))
    states = slice(int(np.searchsorted(run.tick_ns, start_ns)), last)
    efforts = slice(int(np.searchsorted(run.tick_ns, start_ns, "right")), last)
    return PhaseSpan(index, name, start_ns, end_ns, rows, states, efforts)
