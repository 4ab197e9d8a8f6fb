"""Wrench history: force and torque over time as another program has worked them out."""

from dataclasses import dataclass

import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, at_point
from sms_handover.configuration.conditions_fields import BODY, WORLD
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, freeze

_UPRIGHT = np.eye(3)
_CENTRE = np.zeros(3)  # m


@dataclass(frozen=True, eq=False)
class WrenchHistory:
    """Rows (k, 7) of time s, force N and torque N m about the origin of the body, in ``axes``.

    Linear between the rows and zero outside them; a tick has the wrench of its middle. Raises
    ConfigurationError unless time grows from row to row.
    """

    rows: Array
    axes: str = WORLD

    def __post_init__(self) -> None:
        freeze(self, "rows")
        times = self.rows[:, 0]
        if not np.all(np.diff(times) > 0.0):
            later = int(np.argmax(np.diff(times) <= 0.0)) + 1
            raise ConfigurationError(
                f"time of row {later} is {times[later]:g} s, must be > {times[later - 1]:g} s, that before it"
            )

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over a tick."""
        (row,) = self.at(np.array([start_s + 0.5 * tick_s]))
        return at_point(row[:3], row[3:], _CENTRE, body.rotation if self.axes == BODY else _UPRIGHT)

    def at(self, times_s: Array) -> Array:
        """Return forces and torques (k, 6) at some times (k,)."""
        times, columns = self.rows[:, 0], self.rows.T[1:]
        return np.column_stack([np.interp(times_s, times, c, left=0.0, right=0.0) for c in columns])
