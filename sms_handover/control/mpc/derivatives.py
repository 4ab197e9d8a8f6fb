"""Derivatives of the dynamics at one instant of a prediction, by Pinocchio or by whatever else has them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array

PINOCCHIO, COMPILED = "pinocchio", "compiled"
LINEARISATIONS = (PINOCCHIO, COMPILED)


@dataclass(frozen=True, eq=False)
class MassMatrix:
    """Blocks of H: the inverse of H_b (6, 6), H_bm (6, n) and H_m (n, n)."""

    inverse: Array
    coupling: Array
    joints: Array


@dataclass(frozen=True, eq=False)
class InstantDerivatives:
    """Derivatives at one instant: of the momentum, and of the efforts u = H* a + c* (n,) N m.

    ``momentum`` (6, n) is that of H_b nu + H_bm w by joint angles. The efforts are those of a base that
    nothing acts on; ``by_q``, ``by_a`` (n, n) are by joint angles and accelerations, ``by_v`` (n, 6 + n) by
    the twist of the base and joint rates.
    """

    momentum: Array
    effort: Array
    by_q: Array
    by_v: Array
    by_a: Array


class DynamicsDerivatives(Protocol):
    """Finds the derivatives at a configuration q (7 + n,), a velocity v (6 + n,) and accelerations a (n,)."""

    def at(self, q: Array, v: Array, a: Array, mass: MassMatrix) -> InstantDerivatives:
        """Return all derivatives; ``mass`` is H there."""

    def momentum(self, q: Array, v: Array) -> Array:
        """Return those of the momentum alone, (6, n)."""


class PinocchioDerivatives:
    """Pinocchio's analytic derivatives of the inverse dynamics [Carpentier2018]; owns work space."""

    def __init__(self, robot: RobotModel) -> None:
        self._model, self._data = robot.pin, robot.pin.createData()
        self._still, self._acceleration = np.zeros(robot.pin.nv), np.zeros(robot.pin.nv)

    def momentum(self, q: Array, v: Array) -> Array:
        """Return the derivative (6, n): that of H(q) v as the forces of an acceleration v at rest."""
        by_q = pin.computeRNEADerivatives(self._model, self._data, q, self._still, v)[0]
        return np.array(by_q[:BASE_NV, BASE_NV:])

    def at(self, q: Array, v: Array, a: Array, mass: MassMatrix) -> InstantDerivatives:
        """Return all derivatives; the base accelerates by -H_b^-1 f_b, and takes no wrench."""
        momentum = self.momentum(q, v)
        model, data, acceleration, inverse = self._model, self._data, self._acceleration, mass.inverse
        acceleration[:BASE_NV], acceleration[BASE_NV:] = 0.0, a
        forces = pin.rnea(model, data, q, v, acceleration)
        acceleration[:BASE_NV] = -inverse @ forces[:BASE_NV]
        by_q, by_v, _ = pin.computeRNEADerivatives(model, data, q, v, acceleration)
        yielding = mass.coupling.T @ inverse
        return InstantDerivatives(
            momentum,
            np.array(data.tau[BASE_NV:]),
            by_q[BASE_NV:, BASE_NV:] - yielding @ by_q[:BASE_NV, BASE_NV:],
            by_v[BASE_NV:] - yielding @ by_v[:BASE_NV],
            mass.joints - yielding @ mass.coupling,
        )


def mass_matrix(robot: RobotModel, data: pin.Data, q: Array) -> tuple[MassMatrix, Array]:
    """Return H at a configuration (7 + n,), and H_b (6, 6)."""
    inertia = pin.crba(robot.pin, data, q, pin.Convention.LOCAL)
    base, coupling = np.array(inertia[:BASE_NV, :BASE_NV]), np.array(inertia[:BASE_NV, BASE_NV:])
    return MassMatrix(np.linalg.inv(base), coupling, np.array(inertia[BASE_NV:, BASE_NV:])), base
