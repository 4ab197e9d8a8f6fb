"""Joint friction: viscous, Coulomb and Stribeck friction with stiction, implicit over a tick."""

import eigenpy
import numpy as np
import pinocchio as pin

from sms_handover.conditions.joint_values import FrictionValues
from sms_handover.model.impulses import impulse_response
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.complementarity import product, solve_bounded
from sms_handover.types import Array, frozen


class JointFriction:
    """Friction torques of the joints over ticks of ``h`` s.

    The torque is that of the velocity w at the end of the tick, and is held over it [Stewart1996]:

        tau = -f_v w + x,    |x| <= b,    x = -b sign(w) where w != 0
        b = tau_c + (tau_s - tau_c) exp(-(w_0 / v_s)^2) [Armstrong1994]
        w = w_free + h A tau

    with w_free the velocity that the other torques lead to, w_0 that at the start of the tick, and A the
    joints' part of H^-1. Where w = 0 the joint sticks, and x is what keeps it. That is a problem of
    complementarity with one solution, whatever the tick: stable where an explicit torque alternates.
    """

    def __init__(self, values: FrictionValues, h: float) -> None:
        self._values, self._h = values, h
        self._sticking = np.flatnonzero(values.stiction)  # joints with a part that does not vanish at rest
        self._diagonal = np.diag(values.viscous)

    def torque(self, robot: RobotModel, q: Array, v: Array, generalized: Array) -> Array:
        """Return the friction torques (n,) N m over a tick from q (7 + n,) and v (6 + n,).

        ``generalized`` (6 + n,) are the wrench on the base, in its axes, and the torques that act beside it.
        """
        values, at = self._values, self._sticking
        gained = pin.aba(robot.pin, robot.data, q, v, generalized, pin.Convention.WORLD)
        free = (v + self._h * gained)[BASE_NV:]
        inverse = self._h * impulse_response(robot, q)[BASE_NV:]
        # w = M (x + inverse^-1 w_free), with M^-1 = inverse^-1 + f_v.
        stiff = eigenpy.LLT(inverse).solve(np.eye(free.size))
        matrix = eigenpy.LLT(stiff + self._diagonal).solve(np.eye(free.size)).reshape(stiff.shape)
        matrix = 0.5 * (matrix + matrix.T)
        end = product(matrix, product(0.5 * (stiff + stiff.T), free))
        held = np.zeros(free.size)
        if at.size:
            bound = self._bound(v[BASE_NV:])[at]
            part = matrix[np.ix_(at, at)]
            held[at] = solve_bounded(part, end[at] - product(part, bound), 2.0 * bound) - bound
            end = end + product(matrix, held)
        return frozen(held - values.viscous * end)

    def _bound(self, rate: Array) -> Array:
        """Return what dry friction (n,) N m is at most, at rates (n,) rad/s at the start of a tick."""
        values = self._values
        falling = np.exp(-np.square(rate / values.stribeck_speed))
        bound: Array = values.coulomb + (values.stiction - values.coulomb) * falling
        return bound
