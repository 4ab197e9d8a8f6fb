"""Impulses at the joints of a free-floating robot, and the velocity at the end of a short tick."""

import eigenpy
import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array


def impulse_response(robot: RobotModel, q: Array) -> Array:
    """Return H^-1 (0, 1) (6 + n, n): the change of v by a unit impulse in N m s at each joint.

    The rows of the base are its reaction: nothing outside acts on it, so momentum stays as it is.
    """
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    solved: Array = eigenpy.LLT(inertia).solve(np.eye(robot.pin.nv)[:, BASE_NV:])
    return solved.reshape(robot.pin.nv, -1)  # one column comes back as a vector


def predicted_velocity(robot: RobotModel, q: Array, v: Array, effort: Array, h: float) -> Array:
    """Return v + h v' (6 + n,), with v' from H v' + c = (0, u) under joint efforts (n,) N m."""
    generalized = np.concatenate([np.zeros(BASE_NV), effort])
    result: Array = v + h * pin.aba(robot.pin, robot.data, q, v, generalized, pin.Convention.WORLD)
    return result
