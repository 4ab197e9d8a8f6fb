"""Joint friction: viscous, Coulomb and Stribeck friction with stiction, implicit over a tick."""

import eigenpy
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from sms_handover.conditions.joint_values import FrictionValues
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.complementarity import product, solve_bounded
from sms_handover.types import Array, frozen

_AT_REST = 1e-6  # [rad/s] a guess that saves time and changes nothing


class JointFriction:
    """Friction torques of the joints over ticks of ``h`` s.

    The torque is that of the velocity w at the end of the tick, and is held over it [Stewart1996]:

        tau = -f_v w + x,    |x| <= b,    x = -b sign(w) where w != 0
        b = tau_c + (tau_s - tau_c) exp(-(w_0 / v_s)^2) [Armstrong1994]
        H* (w - w_0) / h + c* = u + tau

    with w_0 the velocity at the start of the tick, and H*, c* the reduced dynamics there. Where w = 0 the
    joint sticks, and x is what keeps it. That is a problem of complementarity with one solution, whatever the
    tick: stable where an explicit torque alternates.
    """

    def __init__(self, values: FrictionValues, h: float) -> None:
        self.values, self._h = values, h
        self._sticking = np.flatnonzero(values.stiction)  # joints with a part that does not vanish at rest
        self._diagonal = np.diag(values.viscous)

    def torque(self, robot: RobotModel, q: Array, v: Array, generalized: Array) -> Array:
        """Return the friction torques (n,) N m over a tick from q (7 + n,) and v (6 + n,).

        ``generalized`` (6 + n,) are the wrench on the base, in its axes, and the torques that act beside it.
        """
        values, at, rate = self.values, self._sticking, v[BASE_NV:]
        inertia, pushed = _reduced(robot, q, v, generalized)
        inertia /= self._h
        # w = M (x + H* w_0 / h + u - c*), with M^-1 = H* / h + f_v
        solver = eigenpy.LLT(inertia + self._diagonal)
        end = np.ravel(solver.solve(product(inertia, rate) + pushed))
        dry = np.zeros(rate.size)
        if at.size:
            matrix = solver.solve(np.eye(rate.size)).reshape(inertia.shape)
            rests = np.abs(rate[at]) < _AT_REST
            part = matrix if at.size == rate.size else matrix[np.ix_(at, at)]
            dry[at] = _dry(part, end[at], self._bound(rate)[at], rests)
            end = end + product(matrix, dry)
        return frozen(dry - values.viscous * end)

    def _bound(self, rate: Array) -> Array:
        """Return what dry friction (n,) N m is at most, at rates (n,) rad/s at the start of a tick."""
        values = self.values
        falling = np.exp(-np.square(rate / values.stribeck_speed))
        bound: Array = values.coulomb + (values.stiction - values.coulomb) * falling
        return bound


def _dry(matrix: Array, end: Array, bound: Array, rests: npt.NDArray[np.bool_]) -> Array:
    """Return dry friction (k,) N m: |x| <= b, and against the velocity M x + ``end`` where there is one.

    With d = sign(end), x = d (y - b) has y = 0 where a joint goes on as it would without friction, so that
    few joints are on another side than at first; those that ``rests`` names are likely to stick.
    """
    direction = np.where(end < 0.0, -1.0, 1.0)
    matrix = 0.5 * (matrix + matrix.T) * np.outer(direction, direction)
    result: Array = direction * (
        solve_bounded(matrix, direction * end - product(matrix, bound), 2.0 * bound, rests) - bound
    )
    return result


def _reduced(robot: RobotModel, q: Array, v: Array, generalized: Array) -> tuple[Array, Array]:
    """Return H* (n, n) and u - c* (n,) N m with a wrench on the base, by sums of a fixed order."""
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    forces = generalized - pin.nonLinearEffects(robot.pin, robot.data, q, v)
    coupling = inertia[:BASE_NV, BASE_NV:]
    right = np.column_stack([coupling, forces[:BASE_NV]])
    solved = robot.base_solver.compute(inertia[:BASE_NV, :BASE_NV]).solve(right)
    reaction = np.add.reduce(coupling[:, :, np.newaxis] * solved[:, np.newaxis, :])
    return inertia[BASE_NV:, BASE_NV:] - reaction[:, :-1], forces[BASE_NV:] - reaction[:, -1]
