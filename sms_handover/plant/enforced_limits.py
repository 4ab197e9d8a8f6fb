"""Enforced limits: steps of the robot in which motors and joint stops keep the limits of the joints."""

import numpy as np

from sms_handover.model.robot_model import BASE_NQ, RobotModel
from sms_handover.plant.joint_stops import JointStops
from sms_handover.plant.stepper import Stepper
from sms_handover.plant.torque_speed import TorqueSpeedLine
from sms_handover.types import Array, frozen


class EnforcedLimits:
    """Steps of ``h`` s by another stepper, with torque-speed lines and joint stops.

    Where no joint comes near a limit a step is that of the stepper, bit for bit. A joint that reaches a stop
    passes it by at most its way in that tick. Nothing is carried from tick to tick.
    """

    def __init__(self, robot: RobotModel, stepper: Stepper, rated_share: float, h: float) -> None:
        self._stepper = stepper
        self._stops = JointStops(robot, h)
        self._line = TorqueSpeedLine(robot, rated_share, h)
        self._no_stops = np.zeros(robot.n_joints)

    def step(self, q: Array, v: Array, asked: Array) -> tuple[Array, Array, Array, float]:
        """Return q, v, the efforts (n,) N m that motors gave, and the energy in J that stops took."""
        side = self._stops.reached(q)
        stops = None if side is None else self._stops.efforts(q, v, asked, side)
        effort = asked
        q_next, v_next = self._advance(q, v, effort, stops)
        if self._line.reached(v_next):
            effort = self._line.limited(q, v, asked, self._no_stops if stops is None else stops)
            if effort is not asked:
                q_next, v_next = self._advance(q, v, effort, stops)
        lost = 0.0
        if stops is not None:
            for part in (stops * (q_next - q)[BASE_NQ:]).tolist():
                lost -= part
        side = self._stops.reached(q_next)
        if side is not None:
            v_next, taken = self._stops.impact(q_next, v_next, side)
            lost += taken
        return q_next, v_next, effort, lost

    def _advance(self, q: Array, v: Array, effort: Array, stops: Array | None) -> tuple[Array, Array]:
        """Return q and v after a step under motors and stops."""
        return self._stepper.step(q, v, effort if stops is None else frozen(effort + stops))
