"""Steppers: advance the robot by one tick under constant joint efforts."""

from typing import Protocol

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.integrators import LieGroupIntegrator, Tableau
from sms_handover.types import Array

# Axes in which Pinocchio works. Those of the world take a tenth less time than those of the joints, with a
# rounding that grows with the distance to the origin; the integrator keeps the base at the origin.
_IN_WORLD = pin.Convention.WORLD


class Stepper(Protocol):
    """Steps of a fixed length of the free-floating robot."""

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""


class PinocchioStepper:
    """Steps of ``h`` s by Pinocchio's articulated-body algorithm, one call for each stage of the scheme.

    An instance owns work space, so it is not to be shared between threads.
    """

    def __init__(self, robot: RobotModel, tableau: Tableau, h: float) -> None:
        self._model, self._data = robot.pin, robot.data
        self._springs = robot.springs
        self._integrator = LieGroupIntegrator(robot.pin, tableau, h)
        self._generalized = np.zeros(robot.pin.nv)  # (0, u): no wrench on the base

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        self._generalized[BASE_NV:] = effort
        return self._integrator.step(self._acceleration, q, v)

    def _acceleration(self, q: Array, v: Array) -> Array:
        """Return v' (6 + n,) from H v' + c = (0, u), with u of springs where they are."""
        if self._springs:
            self._generalized[-len(self._springs) :] = self._springs.torque(q, v)
        result: Array = pin.aba(self._model, self._data, q, v, self._generalized, _IN_WORLD)
        return result
