"""Planned lines: where the tools were to go by the plans of a predictive law, for a scene."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.plan_report import PlannedPaths
from sms_handover.run_data import Stamps
from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class PlannedLines:
    """A line (P, A, K, 3) m in ``world`` for each of A arms, at P instants ``stamp_ns`` (P,)."""

    stamp_ns: Stamps
    points: Array

    def __post_init__(self) -> None:
        self.stamp_ns.setflags(write=False)
        freeze(self, "points")


def planned_lines(paths: Sequence[PlannedPaths], arms: Sequence[str]) -> PlannedLines | None:
    """Return the lines of some paths, None without any.

    Those with fewer points than others end with their last point some times; NaN where an arm has none.
    """
    if not paths:
        return None
    most = max(len(path) for item in paths for path in item.tool_in_world.values())
    points = np.full((len(paths), len(arms), most, 3), np.nan)
    for row, item in enumerate(paths):
        for column, arm in enumerate(arms):
            path = item.tool_in_world.get(arm)
            if path is not None and len(path):
                points[row, column] = np.pad(path, ((0, most - len(path)), (0, 0)), mode="edge")
    return PlannedLines(np.array([item.stamp_ns for item in paths], dtype=np.int64), points)
