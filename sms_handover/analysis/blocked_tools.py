"""Blocked tools: those off their targets at the end of a phase while a limit of a predictive law binds."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.analysis.settling import steady_rows
from sms_handover.analysis.tracking import Motion, ToolTracking
from sms_handover.plan_report import PlanReport

_BLOCKING = ("distance ", "position of ", "base attitude ")  # rows of places; those of rates only slow down
_LASTING = 0.5  # [-] of the solves of the steady part, in which a row has to bind to count as the reason


@dataclass(frozen=True)
class BlockedTool:
    """A tool that is ``error`` m off its target at the end of a phase, and the row that binds there."""

    phase: str
    arm: str
    row: str
    error: float


def blocked_tools(plans: Sequence[PlanReport], tools: Iterable[ToolTracking]) -> tuple[BlockedTool, ...]:
    """Return the tools that are to move and end a phase outside their settling bands while a limit binds.

    It is the row of distances, joint positions or the base's attitude that binds in most solves of the last
    tenth of the phase, and in at least half of them.
    """
    off = [tool for tool in tools if tool.motion is not Motion.HOLD and tool.final_error > tool.band]
    rows = [_lasting_row(plans, tool) for tool in off]
    return tuple(
        BlockedTool(tool.phase.name, tool.arm, row, tool.final_error)
        for tool, row in zip(off, rows, strict=True)
        if row
    )


def _lasting_row(plans: Sequence[PlanReport], tool: ToolTracking) -> str:
    """Return the row that binds at the end of the phase of a tool, '' without one."""
    stamps = np.array([plan.stamp_ns for plan in plans], dtype=np.int64)
    at_end = np.flatnonzero(steady_rows(stamps, tool.phase) & (stamps < tool.phase.end_ns)).tolist()
    bound = Counter(row for index in at_end for row in plans[index].active if row.startswith(_BLOCKING))
    row, count = max(bound.items(), key=lambda item: item[1], default=("", 0))
    return row if count >= _LASTING * len(at_end) else ""
