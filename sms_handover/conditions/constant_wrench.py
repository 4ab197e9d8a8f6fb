"""Constant wrench: solar pressure or drag over a short run, a leak, a calibration force."""

from dataclasses import dataclass

import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, at_point
from sms_handover.configuration.conditions_fields import BODY, WORLD
from sms_handover.types import Array, freeze

_UPRIGHT = np.eye(3)


@dataclass(frozen=True, eq=False)
class ConstantWrench:
    """Force (3,) N at ``point`` (3,) m of the body, and torque (3,) N m, constant in ``axes``.

    The point is in the axes of the body. Where the wrench turns with the body it follows from tick to tick.
    """

    force: Array
    torque: Array
    point: Array
    axes: str = WORLD

    def __post_init__(self) -> None:
        freeze(self, "force", "torque", "point")

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over a tick."""
        if self.axes == BODY:
            return at_point(self.force, self.torque, self.point, body.rotation)
        return at_point(self.force, self.torque, body.rotation @ self.point, _UPRIGHT)
