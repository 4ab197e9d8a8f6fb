"""Compiled dynamics: what plant and controller use in place of Pinocchio's algorithms."""

import hashlib
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from sms_handover.compiled.c_function import CFunction
from sms_handover.compiled.compiler import library_of
from sms_handover.compiled.tree import Body, body_tree
from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.errors import ConfigurationError, MissingDependencyError
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.types import Array, frozen

_STEP, _COMPUTED_TORQUE = "step", "computed_torque"  # names of the C functions
_TOLERANCE = 1e-9  # [-] of the largest value; rounding leaves 1e-14
_SEED = 0
_EXAMPLE_S = 1e-3  # [s] short, so that rounding is not amplified by a light wrist


class CompiledStepper:
    """Steps of ``h`` s as :class:`~sms_handover.plant.stepper.PinocchioStepper`; not thread-safe."""

    def __init__(self, robot: RobotModel, tableau: Tableau, h: float) -> None:
        """Compile the step unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        library = _library(_STEP, robot, tableau)
        size = robot.n_joints
        self._q, self._v, self._u = np.zeros(BASE_NQ + size), np.zeros(BASE_NV + size), np.zeros(size)
        self._q_next, self._v_next = np.zeros_like(self._q), np.zeros_like(self._v)
        duration = np.array([_EXAMPLE_S])
        arguments = (self._q, self._v, self._u, duration)
        self._function = CFunction(library, _STEP, arguments, (self._q_next, self._v_next))
        example = _example(robot)
        theirs = PinocchioStepper(robot, tableau, _EXAMPLE_S).step(*example)
        _require_equal(library, [*zip(self.step(*example), theirs, strict=True)])
        duration[0] = h

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return configuration (7 + n,) and velocity (6 + n,) after one step, as read-only arrays."""
        self._q[:] = q
        self._v[:] = v
        self._u[:] = effort
        self._function()
        return frozen(self._q_next.copy()), frozen(self._v_next.copy())


class CompiledComputedTorque:
    """Joint efforts as :class:`~sms_handover.control.computed_torque.ComputedTorque`; not thread-safe."""

    def __init__(self, robot: RobotModel) -> None:
        """Compile it unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        library = _library(_COMPUTED_TORQUE, robot)
        size = robot.n_joints
        self._q, self._v = np.zeros(BASE_NQ + size), np.zeros(BASE_NV + size)
        self._desired, self._feedback = np.zeros((3, size)), np.zeros(2)
        self._efforts = np.zeros(size)
        arguments = (self._q, self._v, self._desired, self._feedback)
        self._function = CFunction(library, _COMPUTED_TORQUE, arguments, (self._efforts,))
        q, v, wanted = _example(robot)
        desired = np.array([0.9 * q[BASE_NQ:], 0.9 * v[BASE_NV:], wanted])
        example = (q, v, desired, np.array([[2.0], [3.0]]))
        _require_equal(library, [(self(*example), ComputedTorque(robot)(*example))])

    def __call__(self, q: Array, v: Array, desired: Array, feedback: Array) -> Array:
        """Return the joint efforts (n,) N m, not limited."""
        self._q[:] = q
        self._v[:] = v
        self._desired[:] = desired
        self._feedback[:] = feedback[:, 0]
        self._function()
        efforts: Array = self._efforts.copy()
        return efforts


def _library(name: str, robot: RobotModel, *scheme: Tableau) -> Path:
    """Return the library of a C function for a robot, and for a scheme if it needs one."""
    bodies = body_tree(robot)
    identity = _identity(bodies, "".join(map(repr, scheme)))
    return library_of(name, identity, lambda: getattr(_writer(), f"{name}_source")(name, bodies, *scheme))


def _identity(bodies: tuple[Body, ...], scheme: str) -> bytes:
    """Return a digest of all that the C code depends on: robot, scheme and code generator."""
    digest = hashlib.sha256(f"{scheme} casadi {_casadi_version()}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    for body in bodies:
        for numbers in (body.rotation, body.place, body.axis, body.first_moment, body.inertia):
            digest.update(np.ascontiguousarray(numbers).tobytes())
        digest.update(np.array([body.parent, body.mass, body.rotor]).tobytes())
    return digest.digest()


def _writer() -> Any:
    """Return the C code generator; CasADi is imported only where code must be generated."""
    try:
        return import_module("sms_handover.compiled.source")
    except ModuleNotFoundError as error:
        if error.name != "casadi":
            raise
        raise MissingDependencyError("compiled dynamics", "casadi", "compiled") from error


def _casadi_version() -> str:
    """Return the version of CasADi, '' without it: cached libraries do not need it."""
    try:
        return version("casadi")
    except PackageNotFoundError:
        return ""


def _example(robot: RobotModel) -> tuple[Array, Array, Array]:
    """Return a fixed q, v and one value per joint."""
    random = np.random.default_rng(_SEED)
    base = pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(random.normal(size=3)), random.normal(size=3)))
    q = np.concatenate([base, random.uniform(-1.0, 1.0, robot.n_joints)])
    return q, random.uniform(-0.1, 0.1, robot.pin.nv), random.uniform(-1.0, 1.0, robot.n_joints)


def _require_equal(library: Path, pairs: list[tuple[Array, Array]]) -> None:
    """Raise ConfigurationError unless a library agrees with Pinocchio."""
    for ours, theirs in pairs:
        apart = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
        if not apart <= _TOLERANCE:
            raise ConfigurationError(
                f"compiled dynamics in {library} differ from Pinocchio by {apart:.1e} of the largest value, "
                f"must be <= {_TOLERANCE:g}: remove the file, or use dynamics 'pinocchio'"
            )
