"""Thruster misfire: a valve that opens by mistake, for a while."""

from dataclasses import dataclass

import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, at_point
from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class ThrusterMisfire:
    """Force (3,) N at ``point`` (3,) m, both in the axes of the body, from ``start`` s on for ``duration`` s.

    A tick in which it acts for a part only has that part of the force, so that the impulse is F duration
    whatever the tick.
    """

    force: Array
    point: Array
    start: float
    duration: float

    def __post_init__(self) -> None:
        freeze(self, "force", "point")

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over a tick."""
        end_s = min(start_s + tick_s, self.start + self.duration)
        share = max(0.0, end_s - max(start_s, self.start)) / tick_s
        return at_point(share * self.force, np.zeros(3), self.point, body.rotation)
