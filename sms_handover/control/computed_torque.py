"""Computed torque: joint efforts under which tracking errors obey a linear differential equation."""

from collections.abc import Callable

import numpy as np

from sms_handover.model.reduced import reduced_inverse_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, BASE_NV, Array

# u (n,) N m of q (7 + n,), v (6 + n,), desired (3, n) with rows q_d, q_d', q_d'', and feedback (2, n)
# with rows a_1, a_2, the same for every joint
TrackingEfforts = Callable[[Array, Array, Array, Array], Array]


class ComputedTorque:
    """u = H*(q_d'' - a_1 e - a_2 e') + c*, so that e'' + a_2 e' + a_1 e = 0, with e = q_m - q_d.

    H* and c* are those of the arms on the free base. Not thread-safe.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._errors = np.zeros((2, robot.n_joints))  # rows e, e'
        self._error, self._error_rate = self._errors

    def __call__(self, q: Array, v: Array, desired: Array, feedback: Array) -> Array:
        """Return the joint efforts (n,) N m, not limited."""
        np.subtract(q[BASE_NQ:], desired[0], out=self._error)
        np.subtract(v[BASE_NV:], desired[1], out=self._error_rate)
        self._errors *= feedback
        wanted = desired[2] - self._error - self._error_rate  # in a fixed order, as every sum of the loop
        return reduced_inverse_dynamics(self._robot, q, v, wanted)
