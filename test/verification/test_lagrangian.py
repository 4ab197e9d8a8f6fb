"""Equations of motion: Pinocchio against the Lagrangian of the bodies.

Agreement is limited by rounding alone: about ten frames of a dozen operations each, seen through
the map of Euler rates to body twists, whose condition number enters squared.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.compiled.dynamics import CompiledComputedTorque, CompiledStepper
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.reduced import (
    generalized_jacobian,
    reduced_dynamics,
    reduced_inverse_dynamics,
    tool_jacobian,
)
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import Tableau
from sms_handover.types import Array
from test.core.robots import someone_else
from test.evidence import Record
from test.verification.lagrangian import Lagrangian, pinocchio_configuration

_STATES = 100
_PITCH = 1.0  # [rad] largest pitch; Euler rates are singular at pi/2
_EPS = float(np.finfo(float).eps)
_EULER = (1.0 + np.sin(_PITCH)) / (1.0 - np.sin(_PITCH))  # cond(E)^2 at that pitch
_ROUNDING = 10 * 12 * _EPS * _EULER  # [-] ten frames of a dozen operations: 3e-13
_ASKED = 1e-10  # [-] where rounding alone, times cond(H), would allow more than we want to see
_EULER_SCHEME = Tableau(1, ((),), (0,), ((1.0,),))
_AGAINST = "Lagrangian in Euler angles, CasADi"


@dataclass(frozen=True)
class Pair:
    """One robot in both ways."""

    name: str
    robot: RobotModel
    lagrangian: Lagrangian

    def states(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield random states: q with Euler angles, q with the quaternion, v with the body twist."""
        random = np.random.default_rng(3)
        low, high = np.maximum(self.robot.lower, -np.pi), np.minimum(self.robot.upper, np.pi)
        reach = np.array([np.pi, _PITCH, np.pi])
        for _ in range(_STATES):
            base = np.concatenate([random.uniform(-1.0, 1.0, 3), random.uniform(-reach, reach)])
            q = np.concatenate([base, random.uniform(low, high)])
            yield q, pinocchio_configuration(q), random.uniform(-1.0, 1.0, self.robot.pin.nv)

    def worst(self, error: Callable[[Array, Array, Array], float]) -> float:
        """Return the largest error over the states."""
        return max(error(*state) for state in self.states())


@pytest.fixture(scope="module", params=["the shipped robot", "a robot with every number changed"])
def pair(request: pytest.FixtureRequest) -> Pair:
    """Two robots: a suite that sees one only cannot tell a convention from a coincidence."""
    description = load_robot()
    if request.param != "the shipped robot":
        description = someone_else(description, seed=5)
    return Pair(request.param, RobotModel(description), Lagrangian(description))


def _mass_matrix(robot: RobotModel, q: Array) -> Array:
    return np.array(pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD))


def _relative(found: Array, expected: Array) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def _balance(inertia: Array) -> Array:
    """Return diag(H)^-1/2, which gives every degree of freedom the same weight.

    cond(H) is about 6e5 because a spacecraft is heavier than a wrist, not because H is hard to
    solve with; balanced it is below 1e3.
    """
    return np.asarray(1.0 / np.sqrt(np.diag(inertia)))


def _cond(inertia: Array) -> float:
    weights = _balance(inertia)
    return float(np.linalg.cond(weights[:, None] * inertia * weights))


def test_mass_matrix(pair: Pair, record: Record) -> None:
    """H is the second derivative of the kinetic energy by the velocities."""

    def error(q: Array, q_pin: Array, v: Array) -> float:
        expected = pair.lagrangian.motion(q, v).inertia
        weights = _balance(expected)
        return float(np.max(np.abs(_mass_matrix(pair.robot, q_pin) - expected) * weights[:, None] * weights))

    claim = f"mass matrix of {pair.name}, largest entry of the difference, balanced, {_STATES} states"
    record(claim, pair.worst(error), _ROUNDING, against=_AGAINST)


def test_bias_forces(pair: Pair, record: Record) -> None:
    """The bias is what Lagrange's equations hold beyond H q'': three terms, each rounded."""

    def error(q: Array, q_pin: Array, v: Array) -> float:
        found = pin.nonLinearEffects(pair.robot.pin, pair.robot.data, q_pin, v)
        return _relative(found, pair.lagrangian.motion(q, v).bias)

    claim = f"bias forces of {pair.name}, relative, {_STATES} states"
    record(claim, pair.worst(error), 3.0 * _ROUNDING, against=_AGAINST)


def test_kinetic_energy(pair: Pair, record: Record) -> None:
    """The energy that the plant reports is the sum over the bodies."""

    def error(q: Array, q_pin: Array, v: Array) -> float:
        expected = pair.lagrangian.energy(q, v)
        return abs(conserved_quantities(pair.robot, q_pin, v).kinetic_energy - expected) / expected

    claim = f"kinetic energy of {pair.name}, relative, {_STATES} states"
    record(claim, pair.worst(error), _ROUNDING, against=_AGAINST)


def test_forward_dynamics(pair: Pair, record: Record) -> None:
    """The accelerations of the plant solve H v' + c = (0, u); the error is that of H times cond(H)."""
    random = np.random.default_rng(4)
    worst_cond = 0.0

    def error(q: Array, q_pin: Array, v: Array) -> float:
        nonlocal worst_cond
        motion = pair.lagrangian.motion(q, v)
        weights = _balance(motion.inertia)
        torque = np.concatenate([np.zeros(BASE_NV), random.uniform(-2.0, 2.0, pair.robot.n_joints)])
        expected = np.linalg.solve(motion.inertia, torque - motion.bias)
        found = pin.aba(pair.robot.pin, pair.robot.data, q_pin, v, torque)
        worst_cond = max(worst_cond, _cond(motion.inertia))
        return _relative(found / weights, expected / weights)

    worst = pair.worst(error)
    claim = f"forward dynamics of {pair.name}, relative in the balanced norm, {_STATES} states"
    record(claim, worst, min(_ASKED, 3.0 * _ROUNDING * worst_cond), against=_AGAINST)


def test_reduced_dynamics(pair: Pair, record: Record) -> None:
    """H* is the inverse of the joint block of H^-1, with no elimination; c* follows from the free motion."""
    worst_cond = 0.0

    def errors(q: Array, q_pin: Array, v: Array) -> tuple[float, float, float]:
        nonlocal worst_cond
        motion = pair.lagrangian.motion(q, v)
        worst_cond = max(worst_cond, _cond(motion.inertia))
        expected = np.linalg.inv(np.linalg.inv(motion.inertia)[BASE_NV:, BASE_NV:])
        weights = _balance(expected)
        drift = np.array(-np.linalg.solve(motion.inertia, motion.bias)[BASE_NV:])
        found = reduced_dynamics(pair.robot, q_pin, v)
        effort = reduced_inverse_dynamics(pair.robot, q_pin, v, drift)  # the free motion needs none
        apart = np.max(np.abs(found.inertia - expected) * weights[:, None] * weights)
        bias = _relative(found.bias * weights, -(expected @ drift) * weights)
        return (
            float(apart),
            bias,
            float(np.linalg.norm(effort * weights) / np.linalg.norm(found.bias * weights)),
        )

    inertia, bias, effort = np.max([errors(*state) for state in pair.states()], axis=0)
    bound = min(_ASKED, 3.0 * _ROUNDING * worst_cond)
    record(f"H* of {pair.name}, balanced, {_STATES} states", inertia, bound, against=_AGAINST)
    record(f"c* of {pair.name}, relative, {_STATES} states", bias, bound, against=_AGAINST)
    claim = f"effort that {pair.name} needs for its free motion, relative to c*, {_STATES} states"
    record(claim, effort, bound, against=_AGAINST)


def test_compiled_dynamics(
    pair: Pair, record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The C code solves the same equations: v' from one step of Euler's scheme, and the efforts of NMPC."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    h = 1.0  # [s] v' is then what v grows by
    stepper, efforts = CompiledStepper(pair.robot, _EULER_SCHEME, h), CompiledComputedTorque(pair.robot)
    random = np.random.default_rng(4)
    worst_cond = 0.0

    def errors(q: Array, q_pin: Array, v: Array) -> tuple[float, float]:
        nonlocal worst_cond
        motion = pair.lagrangian.motion(q, v)
        weights = _balance(motion.inertia)
        torque = random.uniform(-2.0, 2.0, pair.robot.n_joints)
        right = np.concatenate([np.zeros(BASE_NV), torque]) - motion.bias
        expected = np.asarray(np.linalg.solve(motion.inertia, right), dtype=np.float64)
        found = (stepper.step(q_pin, v, torque)[1] - v) / h
        desired = np.array([q_pin[BASE_NQ:], v[BASE_NV:], expected[BASE_NV:]])  # no error of tracking
        effort = efforts(q_pin, v, desired, np.ones_like(desired[:2]))
        worst_cond = max(worst_cond, _cond(motion.inertia))
        return _relative(found / weights, expected / weights), _relative(effort, torque)

    forward, inverse = np.max([errors(*state) for state in pair.states()], axis=0)
    bound = min(_ASKED, 3.0 * _ROUNDING * worst_cond)
    claim = f"compiled forward dynamics of {pair.name}, relative in the balanced norm, {_STATES} states"
    record(claim, forward, bound, against=_AGAINST)
    claim = f"compiled joint efforts of {pair.name}, relative, {_STATES} states"
    record(claim, inverse, bound, against=_AGAINST)


def test_tool_jacobians(pair: Pair, record: Record) -> None:
    """J maps v to the twist of the tool, J* the joint rates that an impulse of the joints brings about."""
    worst_cond = 0.0

    def errors(q: Array, q_pin: Array, v: Array) -> tuple[float, float]:
        nonlocal worst_cond
        inverse = np.array(np.linalg.inv(pair.lagrangian.motion(q, v).inertia))
        worst_cond = max(worst_cond, _cond(inverse))
        ordinary, generalised = 0.0, 0.0
        for arm in pair.robot.arms:
            expected = pair.lagrangian.tool_jacobian(q, arm)
            ordinary = max(ordinary, _relative(tool_jacobian(pair.robot, q_pin, arm), expected))
            response = expected @ inverse[:, BASE_NV:]  # twist of the tool per impulse of a joint
            free = np.linalg.solve(inverse[BASE_NV:, BASE_NV:].T, response.T).T
            generalised = max(generalised, _relative(generalized_jacobian(pair.robot, q_pin, arm), free))
        return ordinary, generalised

    ordinary, generalised = np.max([errors(*state) for state in pair.states()], axis=0)
    record(
        f"tool Jacobians of {pair.name}, relative, {_STATES} states", ordinary, _ROUNDING, against=_AGAINST
    )
    claim = f"generalised Jacobians of {pair.name}, relative, {_STATES} states"
    record(claim, generalised, min(_ASKED, 3.0 * _ROUNDING * worst_cond), against=_AGAINST)
