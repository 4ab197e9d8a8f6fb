"""Torque-speed line: the torque that a motor has left at the speed of its joint."""

import numpy as np

from sms_handover.model.impulses import impulse_response, predicted_velocity
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.complementarity import solve_bounded
from sms_handover.types import Array, frozen


class TorqueSpeedLine:
    """Full torque up to the rated speed, then a straight line to zero at the limit of the rate.

    With the limits u_max and w_max of a joint, r the rated share of w_max, and k = u_max / ((1 - r) w_max),
    a motor that drives its joint, u q_m' > 0, gives at most [Mittal2023]

        |u| <= min(u_max, max(0, k (w_max - |q_m'|))).

    A braking torque is not affected. The line holds for the rate at the end of a tick of ``h`` s: that of its
    start would let a light wrist, which gains its limit in a fraction of a tick, run far past it.
    """

    def __init__(self, robot: RobotModel, rated_share: float, h: float) -> None:
        self._robot, self._h = robot, h
        self._rate_limit = robot.pin.velocityLimit[BASE_NV:].copy()
        self._rated = rated_share * self._rate_limit
        self._slope = robot.effort_limit / (self._rate_limit - self._rated)  # k [N m s/rad]

    def reached(self, v: Array) -> bool:
        """Return whether a joint is faster than its rated speed."""
        return bool(np.count_nonzero(np.abs(v[BASE_NV:]) > self._rated))

    def limited(self, q: Array, v: Array, effort: Array, stops: Array) -> Array:
        """Return the efforts (n,) N m that motors give over a tick from q and v when asked for ``effort``.

        ``stops`` (n,) N m act too. With d = sign(u), the torque x that a motor lacks lowers the rate in the
        direction d by h A x, A the joints' part of H^-1 with the signs d. That is a problem of
        complementarity: 0 <= x <= |u|, and where 0 < x < |u| the line holds,

            |u| - x = k (w_max - d q_m' + h A x).
        """
        direction, size = np.sign(effort), np.abs(effort)
        free = direction * predicted_velocity(self._robot, q, v, effort + stops, self._h)[BASE_NV:]
        inverse = impulse_response(self._robot, q)[BASE_NV:] * np.outer(direction, direction)
        matrix = np.diag(1.0 / self._slope) + self._h * inverse
        lacking = solve_bounded(matrix, self._rate_limit - free - size / self._slope, size)
        return frozen(effort - direction * lacking) if np.count_nonzero(lacking) else effort
