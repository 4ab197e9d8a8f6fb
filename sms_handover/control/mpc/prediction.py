"""Prediction of the robot over a horizon with the momentum eliminated, and its derivatives.

The state is (q_m, w, phi): joint angles and rates, and the rotation vector of the base from its attitude at
the beginning, R = R_0 exp(phi); the input is the joint acceleration a, constant over an interval, so that the
joints are exact double integrators. The base's twist nu = (v, omega) follows from the momentum
[Papadopoulos2021],

    nu = H_b^-1 (h_b - H_bm w),    h_b = (R^T P, R^T L + c x R^T P),

in its own axes, with P and L (about the centre of mass) conserved and c the centre of mass in the base; its
position is that of the centre of mass less R c. Joint efforts are an output, u = H* a + c*: the inverse
dynamics are the better transcription [Ferrolho2021].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.control.mpc.derivatives import DynamicsDerivatives, PinocchioDerivatives, mass_matrix
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.momentum import BaseStart
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array

_ROUNDS = 3  # [-] of the implicit step of the attitude; each shrinks its error by h |omega| / 4, below 0.01


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of r outputs at K instants: by q and w (K, r, n), by phi (K, r, 3), and by a (K, r, n)."""

    q: Array
    w: Array
    phi: Array
    a: Array | None = None


@dataclass(frozen=True, eq=False)
class Prediction:
    """The motion over a horizon of N intervals, and its derivatives at each instant.

    ``q``, ``w`` (N + 1, n); ``phi`` (N + 1, 3) rad and ``omega`` (N + 1, 3) rad/s of the base in its own
    axes; ``twist`` (N + 1, 6) of the base; ``effort`` (N, n) N m where an interval begins. ``centre`` (N + 1,
    3) m is the centre of mass in the base, ``centre_per_q`` (N + 1, 3, n) its derivative, ``centre_in_world``
    (N + 1, 3) m where it is; ``rotation`` (N + 1, 3, 3) is the attitude of the base in ``world``.
    """

    q: Array
    w: Array
    phi: Array
    twist: Array
    effort: Array
    centre: Array
    centre_per_q: Array
    centre_in_world: Array
    rotation: Array
    omega_by: Derivatives
    effort_by: Derivatives

    @property
    def omega(self) -> Array:
        """The angular velocity of the base (N + 1, 3) rad/s in its own axes."""
        return self.twist[:, 3:]


class PredictionModel:
    """Predicts a robot; owns work space of Pinocchio, so it is not to be shared between threads."""

    def __init__(
        self,
        robot: RobotModel,
        derivatives: Callable[[RobotModel], DynamicsDerivatives] = PinocchioDerivatives,
    ) -> None:
        """Predict with derivatives that are made for the robot."""
        self._robot, self._data = robot, robot.pin.createData()
        self._q, self._derivatives = pin.neutral(robot.pin), derivatives(robot)

    def predict(
        self, horizon: Horizon, start: BaseStart, q: Array, w: Array, accelerations: Array
    ) -> Prediction:
        """Return the motion from joint angles and rates (n,) under accelerations (N, n) rad/s^2."""
        n, nodes = self._robot.n_joints, horizon.count + 1
        angles, rates = horizon.motion(q, w, accelerations)
        phi, twist, effort = np.zeros((nodes, 3)), np.zeros((nodes, 6)), np.zeros((nodes - 1, n))
        centre, centre_per_q = np.zeros((nodes, 3)), np.zeros((nodes, 3, n))
        rotation = np.zeros((nodes, 3, 3))
        omega_by = Derivatives(*(np.zeros((nodes, 3, k)) for k in (n, n, 3)))
        effort_by = Derivatives(*(np.zeros((nodes - 1, n, k)) for k in (n, n, 3, n)))
        velocity = np.zeros(BASE_NV + n)
        flow = np.zeros(3)
        full = self._q
        for k in range(nodes):
            full[BASE_NQ:] = angles[k]
            matrix, base = mass_matrix(self._robot, self._data, full)
            inverse, coupling, mass = matrix.inverse, matrix.coupling, base[0, 0]
            c = np.array([base[1, 5], base[2, 3], base[0, 4]]) / mass
            of_joints = coupling @ rates[k]
            if k:
                h, before = horizon.intervals[k - 1], flow
                guess = phi[k - 1] + h * before
                for _ in range(_ROUNDS):
                    nu = inverse @ (_momentum_in_base(start, guess, c) - of_joints)
                    flow = _flow(guess, nu[3:])
                    guess = phi[k - 1] + 0.5 * h * (before + flow)
                phi[k] = guess
            momentum = _momentum_in_base(start, phi[k], c)
            momentum_by_phi, momentum_by_c = _momentum_derivatives(momentum, phi[k], c)
            nu = inverse @ (momentum - of_joints)
            flow = _flow(phi[k], nu[3:])
            twist[k], centre[k], centre_per_q[k] = nu, c, coupling[:3] / mass
            rotation[k] = start.rotation @ pin.exp3(phi[k])
            velocity[:BASE_NV], velocity[BASE_NV:] = nu, rates[k]
            last = k == nodes - 1
            there = None if last else self._derivatives.at(full, velocity, accelerations[k], matrix)
            by_q = there.momentum if there else self._derivatives.momentum(full, velocity)
            nu_q = inverse @ (momentum_by_c @ centre_per_q[k] - by_q)
            nu_w, nu_phi = -inverse @ coupling, inverse @ momentum_by_phi
            omega_by.q[k], omega_by.w[k], omega_by.phi[k] = nu_q[3:], nu_w[3:], nu_phi[3:]
            if there:
                of_twist, of_rates = there.by_v[:, :BASE_NV], there.by_v[:, BASE_NV:]
                effort[k] = there.effort
                effort_by.q[k] = there.by_q + of_twist @ nu_q
                effort_by.w[k] = of_rates + of_twist @ nu_w
                effort_by.phi[k] = of_twist @ nu_phi
                assert effort_by.a is not None
                effort_by.a[k] = there.by_a
        drift = start.linear_momentum / self._robot.mass
        in_world = start.centre_of_mass + horizon.times[:, None] * drift
        return Prediction(
            angles, rates, phi, twist, effort, centre, centre_per_q, in_world, rotation, omega_by, effort_by
        )


def _momentum_in_base(start: BaseStart, phi: Array, c: Array) -> Array:
    """Return the momentum h_b (6,) about the base's origin in its axes."""
    turned = (start.rotation @ pin.exp3(phi)).T
    linear, angular = turned @ start.linear_momentum, turned @ start.angular_momentum
    return np.concatenate([linear, angular + pin.skew(c) @ linear])


def _momentum_derivatives(momentum: Array, phi: Array, c: Array) -> tuple[Array, Array]:
    """Return the derivatives (6, 3) of h_b by phi and by c."""
    turn, around = pin.Jexp3(phi), pin.skew(c)
    linear = pin.skew(momentum[:3])  # d(R^T P) = [R^T P] J_r(phi) dphi
    angular = pin.skew(momentum[3:] - around @ momentum[:3])
    by_phi, by_c = np.zeros((BASE_NV, 3)), np.zeros((BASE_NV, 3))
    by_phi[:3] = linear @ turn
    by_phi[3:] = angular @ turn + around @ by_phi[:3]
    by_c[3:] = -linear
    return by_phi, by_c


def _flow(phi: Array, omega: Array) -> Array:
    """Return dphi/dt = omega + phi x omega / 2 + phi x (phi x omega) / 12, up to phi^4 omega / 720."""
    turn = pin.skew(phi)
    once = turn @ omega
    return np.asarray(omega + 0.5 * once + turn @ once / 12.0)


def flow_derivatives(phi: Array, omega: Array) -> tuple[Array, Array]:
    """Return the derivatives (3, 3) of :func:`_flow` by phi and by omega."""
    turn, spin = pin.skew(phi), pin.skew(omega)
    by_omega = np.eye(3) + 0.5 * turn + turn @ turn / 12.0
    by_phi = -0.5 * spin - (pin.skew(turn @ omega) + turn @ spin) / 12.0
    return by_phi, by_omega
