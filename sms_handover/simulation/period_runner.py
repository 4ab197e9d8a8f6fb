"""Period runner: carries out the ticks of a reference period, here by Python."""

from typing import Protocol

import numpy as np

from sms_handover.control.protocol import Controller
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.types import TickRows


class PeriodRunner(Protocol):
    """What lets plant and controller go through ticks during which guidance does not change."""

    def run(self, ticks: int, steps: int) -> TickRows:
        """Carry out ``ticks`` ticks from the present one, of which the first ``steps`` are integrated."""


class PythonRunner:
    """Ticks by plain calls: the controller answers the state, the plant integrates."""

    def __init__(self, plant: FreeFloatingPlant, controller: Controller) -> None:
        """Run a plant under a controller; both are only used, and may be reset and restored."""
        self._plant, self._controller = plant, controller

    def run(self, ticks: int, steps: int) -> TickRows:
        """Carry out ``ticks`` ticks, of which the first ``steps`` are integrated.

        Raises ControllerError unless the efforts of a user's controller are finite.
        """
        plant, answer = self._plant, self._controller.effort
        stamps, rows = list[int](), list[tuple[object, ...]]()
        for index in range(ticks):
            stamp_ns, q, v, acted = plant.stamp_ns, plant.q, plant.v, plant.joint_effort
            effort = answer(stamp_ns, q, v)
            stamps.append(stamp_ns)
            rows.append((q, v, acted, effort))
            if index < steps:
                plant.apply(effort)
        columns = (np.array(column) for column in zip(*rows, strict=True))
        return TickRows(np.array(stamps), *columns)
