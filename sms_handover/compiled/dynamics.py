"""Compiled dynamics: what plant and controller use in place of Pinocchio's algorithms."""

import ctypes

import numpy as np

from sms_handover.compiled.c_function import CFunction, NativeFunction
from sms_handover.compiled.example import example_of, require_equal
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import COMPUTED_TORQUE, step_name
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.types import Array, frozen

_EXAMPLE_S = 1e-3  # [s] short, so that rounding is not amplified by a light wrist


class CompiledStepper:
    """Steps of ``h`` s as :class:`~sms_handover.plant.stepper.PinocchioStepper`; not thread-safe."""

    def __init__(self, robot: RobotModel, tableau: Tableau, h: float) -> None:
        """Compile the step unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        scheme = next((name for name, known in TABLEAUS.items() if known == tableau), "")
        library = dynamics_library(robot) if scheme else dynamics_library(robot, {scheme: tableau})
        size = robot.n_joints
        self._q, self._v = np.zeros(BASE_NQ + size), np.zeros(BASE_NV + size)
        self._force = np.zeros(BASE_NV + size)  # no wrench on the base
        self._q_next, self._v_next = np.zeros_like(self._q), np.zeros_like(self._v)
        duration = np.array([_EXAMPLE_S])
        parameters = parameters_of(body_tree(robot))
        arguments = (self._q, self._v, self._force, parameters, duration)
        self._function = CFunction(library, step_name(scheme), arguments, (self._q_next, self._v_next))
        example = example_of(robot)
        theirs = PinocchioStepper(robot, tableau, _EXAMPLE_S).step(*example)
        require_equal(library, [*zip(self.step(*example), theirs, strict=True)])
        duration[0] = h

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return configuration (7 + n,) and velocity (6 + n,) after one step, as read-only arrays."""
        self._q[:] = q
        self._v[:] = v
        self._force[BASE_NV:] = effort
        self._function()
        return frozen(self._q_next.copy()), frozen(self._v_next.copy())


class CompiledComputedTorque:
    """Joint efforts as :class:`~sms_handover.control.computed_torque.ComputedTorque`; not thread-safe."""

    def __init__(self, robot: RobotModel) -> None:
        """Compile it unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        library = dynamics_library(robot)
        size = robot.n_joints
        self._q, self._v = np.zeros(BASE_NQ + size), np.zeros(BASE_NV + size)
        self._desired, self._feedback = np.zeros((3, size)), np.zeros(2)
        self._efforts = np.zeros(size)
        parameters = parameters_of(body_tree(robot))
        arguments = (self._q, self._v, self._desired, self._feedback, parameters)
        self._function = NativeFunction(library, COMPUTED_TORQUE, [ctypes.c_void_p] * 6)
        self._parameters = parameters
        self._at = tuple(array.ctypes.data for array in (*arguments, self._efforts))
        q, v, wanted = example_of(robot)
        desired = np.array([0.9 * q[BASE_NQ:], 0.9 * v[BASE_NV:], wanted])
        example = (q, v, desired, np.array([[2.0], [3.0]]))
        require_equal(library, [(self(*example), ComputedTorque(robot)(*example))])

    def __call__(self, q: Array, v: Array, desired: Array, feedback: Array) -> Array:
        """Return the joint efforts (n,) N m, not limited."""
        self._q[:] = q
        self._v[:] = v
        self._desired[:] = desired
        self._feedback[:] = feedback[:, 0]
        self._function(*self._at)
        efforts: Array = self._efforts.copy()
        return efforts
