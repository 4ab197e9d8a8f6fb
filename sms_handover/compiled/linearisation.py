"""Linearisation in C: what a predictive law uses in place of Pinocchio's derivatives."""

from dataclasses import fields

import numpy as np

from sms_handover.compiled.c_function import CFunction
from sms_handover.compiled.example import example_of, require_equal
from sms_handover.compiled.library import linearisation_library
from sms_handover.compiled.names import LINEARISATION
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.control.mpc.derivatives import (
    InstantDerivatives,
    MassMatrix,
    PinocchioDerivatives,
    mass_matrix,
)
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array


class CompiledDerivatives:
    """What :class:`~sms_handover.control.mpc.derivatives.PinocchioDerivatives` has, to rounding.

    Not thread-safe.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Compile it unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        library, n = linearisation_library(robot), robot.n_joints
        self._angles, self._v, self._wanted = np.zeros(n), np.zeros(BASE_NV + n), np.zeros(n)
        self._still = np.zeros(n)
        self._momentum, self._effort = np.zeros((BASE_NV, n)), np.zeros(n)
        self._by_q, self._by_v, self._by_a = np.zeros((n, n)), np.zeros((n, BASE_NV + n)), np.zeros((n, n))
        parameters = parameters_of(body_tree(robot))
        self._function = CFunction(
            library,
            LINEARISATION,
            (self._angles, self._v, self._wanted, parameters),
            (self._momentum, self._effort, self._by_q, self._by_v, self._by_a),
        )
        q, v, wanted = example_of(robot)
        mass, _ = mass_matrix(robot, robot.pin.createData(), q)
        ours, theirs = self.at(q, v, wanted, mass), PinocchioDerivatives(robot).at(q, v, wanted, mass)
        require_equal(
            library, [(getattr(ours, part.name), getattr(theirs, part.name)) for part in fields(theirs)]
        )

    def at(self, q: Array, v: Array, a: Array, mass: MassMatrix) -> InstantDerivatives:
        """Return all derivatives; ``mass`` is not needed."""
        self._call(q, v, a)
        parts = (self._momentum, self._effort, self._by_q, self._by_v, self._by_a)
        return InstantDerivatives(*(part.copy() for part in parts))

    def momentum(self, q: Array, v: Array) -> Array:
        """Return those of the momentum alone, (6, n)."""
        self._call(q, v, self._still)
        momentum: Array = self._momentum.copy()
        return momentum

    def _call(self, q: Array, v: Array, a: Array) -> None:
        """Find all results."""
        self._angles[:], self._v[:], self._wanted[:] = q[BASE_NQ:], v, a
        self._function()
