"""Period runner: carries out the ticks of a reference period, here by Python."""

from typing import Protocol

import numpy as np

from sms_handover.control.protocol import Controller
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.sensed_plant import SensedPlant
from sms_handover.types import Array, TickRows


class PeriodRunner(Protocol):
    """What lets plant and controller go through ticks during which guidance does not change."""

    def run(self, ticks: int, steps: int) -> TickRows:
        """Carry out ``ticks`` ticks from the present one, of which the first ``steps`` are integrated."""


class PythonRunner:
    """Ticks by plain calls: the controller answers the state, the plant integrates."""

    def __init__(
        self, plant: FreeFloatingPlant, controller: Controller, *, uses_measurements: bool = False
    ) -> None:
        """Run a plant under a controller; both are only used, and may be reset and restored.

        With ``uses_measurements`` the controller is given what the sensors of the plant tell.
        """
        self._plant, self._controller = plant, controller
        self._sensed = plant if isinstance(plant, SensedPlant) else None
        self._uses_measurements = uses_measurements

    def run(self, ticks: int, steps: int) -> TickRows:
        """Carry out ``ticks`` ticks, of which the first ``steps`` are integrated.

        Raises ControllerError unless the efforts of a user's controller are finite.
        """
        plant, answer, sensed = self._plant, self._controller.effort, self._sensed
        stamps, rows, measured = list[int](), list[tuple[object, ...]](), list[Array]()
        for index in range(ticks):
            stamp_ns, q, v, acted = plant.stamp_ns, plant.q, plant.v, plant.joint_effort
            known_q, known_v = q, v
            if sensed:
                now = sensed.measured
                measured.append(np.concatenate([now.q, now.v]))
                if self._uses_measurements:
                    known_q, known_v = now.q, now.v
            effort = answer(stamp_ns, known_q, known_v)
            stamps.append(stamp_ns)
            rows.append((q, v, acted, effort))
            if index < steps:
                plant.apply(effort)
        q, v, acted, effort = (np.array(column) for column in zip(*rows, strict=True))
        return TickRows(np.array(stamps), q, v, acted, effort, np.array(measured) if sensed else None)
