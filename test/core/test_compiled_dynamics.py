"""Compiled dynamics: the values of Pinocchio to rounding, and ticks in C that are those of Python."""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import casadi
import numpy as np
import pinocchio as pin
import pytest

from sms_handover.compiled.dynamics import CompiledComputedTorque, CompiledStepper
from sms_handover.compiled.linearisation import CompiledDerivatives
from sms_handover.compiled.rigid_bodies import RigidBodies
from sms_handover.compiled.source import with_parameters
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.compiled.tree import body_tree, lightened_of, parameters_of
from sms_handover.control.mpc.derivatives import MassMatrix, PinocchioDerivatives, mass_matrix
from sms_handover.control.protocol import Guidance
from sms_handover.errors import UnknownNameError
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.reduced import reduced_dynamics, reduced_inverse_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.simulation.period_runner import PythonRunner
from sms_handover.simulation.scenario import Overrides, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import controller_data, plain
from sms_handover.simulation.wiring import make_controller, make_plant, make_runner
from sms_handover.types import Array, JointReference, TaskPhase

from .conftest import Draw
from .robots import someone_else

_TICK = 1e-3  # [s]
_ROUNDING = 1e-12  # [-] of the largest value: ten frames of a dozen operations, and the condition of H

pytestmark = pytest.mark.usefixtures("kept_libraries")


def _one_armed() -> RobotModel:
    description = load_robot()
    return RobotModel(replace(description, arms=description.arms[:1]))


def _badly_mounted() -> RobotModel:
    errors = {"angle": 0.3, "position": 0.05}  # rad, m: the library is that of small errors
    values = {f"conditions.model_error.mounts.{name}": value for name, value in errors.items()}
    return load_scenario(values={**values, "conditions.rotor_inertia": 0.3}).truth.robot


ROBOTS: dict[str, Callable[[], RobotModel]] = {
    "shipped": RobotModel.load,
    "every number changed": lambda: RobotModel(someone_else(load_robot(), seed=6)),
    "one arm": _one_armed,
    "odd mounts": _badly_mounted,
}


@pytest.fixture(scope="module", params=ROBOTS)
def any_robot(request: pytest.FixtureRequest) -> RobotModel:
    return ROBOTS[request.param]()


@pytest.mark.parametrize("axis", np.eye(3).tolist(), ids="xyz")
def test_equations_with_odd_mounts(axis: list[float]) -> None:
    """A mount as turns, and mass that parents take over, about each axis of the frame of a joint."""
    described = someone_else(load_robot(), seed=6)
    arms = (
        replace(arm, joints=tuple(replace(joint, axis=(*axis,)) for joint in arm.joints))
        for arm in described.arms
    )
    robot = RobotModel(replace(described, arms=tuple(arms)))
    bodies = body_tree(robot)
    assert len(lightened_of(bodies)) == robot.n_joints - len(robot.arms)
    numbers, known = with_parameters(bodies)
    angles, v, force = (casadi.SX.sym(*of) for of in (("q", 14), ("v", 20), ("f", 20)))
    equations = RigidBodies(known, casadi.cos(angles), casadi.sin(angles), v)
    both = equations.acceleration(force), equations.articulated_acceleration(force)
    unlike = equations.bias() - equations.bias_by_points()
    found = casadi.Function("found", [angles, v, force, numbers], [*both, unlike, equations.kinetic_energy()])
    draw = Draw(robot, seed=7)
    for _ in range(3):
        q, rates, pushed = draw.q(), draw.v(), draw.vector(robot.pin.nv)
        *accelerations, apart, energy = found(q[BASE_NQ:], rates, pushed, parameters_of(bodies))
        expected = pin.aba(robot.pin, robot.data, q, rates, pushed, pin.Convention.LOCAL)
        for acceleration in accelerations:
            assert _off(np.array(acceleration).ravel(), expected) < _ROUNDING
        assert np.abs(np.array(apart)).max() < 1e-11  # N m, of some 10
        expected_energy = conserved_quantities(robot, q, rates).kinetic_energy
        assert float(energy) == pytest.approx(expected_energy, rel=_ROUNDING)


def _off(found: Array, expected: Array) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("scheme", TABLEAUS)
def test_a_step_is_that_of_pinocchio(any_robot: RobotModel, scheme: str) -> None:
    draw = Draw(any_robot, seed=3)
    compiled = CompiledStepper(any_robot, TABLEAUS[scheme], _TICK)
    ours = PinocchioStepper(any_robot, TABLEAUS[scheme], _TICK)
    for _ in range(20):
        q, v = draw.q(), draw.v()
        effort = draw.effort(q)
        q_next, v_next = compiled.step(q, v, effort)
        q_expected, v_expected = ours.step(q, v, effort)
        assert _off(q_next, q_expected) < _ROUNDING
        assert _off(v_next - v, v_expected - v) < _ROUNDING / _TICK


@pytest.mark.parametrize("tick", [1e-6, 0.02])
def test_a_step_lasts_as_long_as_asked(robot: RobotModel, draw: Draw, tick: float) -> None:
    """Whatever step the library was tried with first."""
    q, v, effort = draw.q(), draw.v(0.1), np.zeros(robot.n_joints)
    found = CompiledStepper(robot, TABLEAUS["rk4"], tick).step(q, v, effort)
    for ours, theirs in zip(
        found, PinocchioStepper(robot, TABLEAUS["rk4"], tick).step(q, v, effort), strict=True
    ):
        assert _off(ours, theirs) < _ROUNDING


@pytest.mark.parametrize("turn", [0.0, 1e-9, 0.0316, 0.0317, 0.5, 3.0])
def test_a_base_that_turns_far_in_a_step_moves_on_its_screw(robot: RobotModel, turn: float) -> None:
    """On both sides of where the series of the exponential map gives way to its closed form."""
    compiled = CompiledStepper(robot, TABLEAUS["midpoint"], _TICK)
    ours = PinocchioStepper(robot, TABLEAUS["midpoint"], _TICK)
    draw = Draw(robot, seed=4)
    q, v = draw.q(), np.zeros(robot.pin.nv)
    v[:3], v[3:BASE_NV] = draw.vector(3), turn / _TICK * np.array([0.6, -0.48, 0.64])
    effort = np.zeros(robot.n_joints)
    assert np.abs(compiled.step(q, v, effort)[0] - ours.step(q, v, effort)[0])[:BASE_NQ].max() < 1e-12


def _desired(draw: Draw) -> Array:
    return np.array([draw.joints(), *draw.random.uniform(-1.0, 1.0, (2, draw.robot.n_joints))])


def _feedback(position: float, velocity: float) -> Array:
    """Return the feedback gains of computed torque, the same for every joint."""
    return np.array([[position], [velocity]])


def test_joint_efforts_are_those_of_the_free_base(any_robot: RobotModel) -> None:
    """Against Pinocchio by two ways: eliminating the base from the forces, and from the matrix."""
    draw, compiled = Draw(any_robot, seed=5), CompiledComputedTorque(any_robot)
    for _ in range(20):
        q, v, desired, gains = draw.q(), draw.v(), _desired(draw), _feedback(7.0, 3.0)
        error, error_rate = q[BASE_NQ:] - desired[0], v[BASE_NV:] - desired[1]
        wanted = desired[2] - gains[0] * error - gains[1] * error_rate
        found, reduced = compiled(q, v, desired, gains), reduced_dynamics(any_robot, q, v)
        assert _off(found, reduced_inverse_dynamics(any_robot, q, v, wanted)) < _ROUNDING
        assert _off(found, reduced.inertia @ wanted + reduced.bias) < _ROUNDING


def test_joint_efforts_bring_about_what_was_asked_for(robot: RobotModel) -> None:
    """The two libraries undo each other: without an error rates grow by the accelerations desired."""
    draw, h = Draw(robot, seed=6), 1e-7  # s
    efforts, stepper = CompiledComputedTorque(robot), CompiledStepper(robot, TABLEAUS["rk4"], h)
    for _ in range(5):
        q, v, wanted = draw.q(), draw.v(), draw.vector(robot.n_joints)
        desired = np.array([q[BASE_NQ:], v[BASE_NV:], wanted])
        _, v_next = stepper.step(q, v, efforts(q, v, desired, _feedback(1e3, 1e2)))
        assert (v_next - v)[BASE_NV:] / h == pytest.approx(wanted, abs=1e-4)


def test_the_results_of_a_call_are_its_own(robot: RobotModel, draw: Draw) -> None:
    """What one tick gave does not change with the next, and cannot be changed."""
    stepper, torque = CompiledStepper(robot, TABLEAUS["rk4"], _TICK), CompiledComputedTorque(robot)
    q, v, effort = draw.q(), draw.v(), np.zeros(robot.n_joints)
    desired, gains = _desired(draw), _feedback(1.0, 1.0)
    first, efforts = stepper.step(q, v, effort), torque(q, v, desired, gains)
    kept = [array.copy() for array in (*first, efforts)]
    stepper.step(*first, effort)
    torque(*first, desired, gains)
    assert all(np.array_equal(a, b) for a, b in zip((*first, efforts), kept, strict=True))
    assert not any(array.flags.writeable for array in first)


def test_a_whole_run_differs_by_rounding_alone() -> None:
    """The approach and the grasp, in closed loop: positions agree, and what is conserved stays so."""
    runs = [
        simulate(load_scenario("colliding", {"common": {"dynamics": name, "duration": 2.0}}))
        for name in ("pinocchio", "compiled")
    ]
    ours, compiled = runs
    assert not np.array_equal(ours.joint_velocity, compiled.joint_velocity)
    assert np.abs(ours.joint_position - compiled.joint_position).max() < 1e-13
    assert np.abs(ours.base_pose - compiled.base_pose).max() < 1e-13
    robot = RobotModel.load()
    end = (
        np.concatenate([compiled.base_pose[-1], compiled.joint_position[-1]]),
        np.concatenate([compiled.base_twist[-1], compiled.joint_velocity[-1]]),
    )
    conserved = conserved_quantities(robot, *end)
    assert np.abs(conserved.linear_momentum).max() < 1e-12
    assert np.abs(conserved.angular_momentum).max() < 1e-12


def test_pid_is_compiled_too() -> None:
    """With limits that are enforced, too: a wrist that is slowed down by its motor's torque-speed line."""
    given: Overrides = {
        "controller": {"law": "pid"},
        "plant": {"joint_limits": "enforce"},
        "robot": {"arms.arm_a.limits": {"joint_7": {"velocity": 0.05}}},
    }
    found, theirs = (
        simulate(load_scenario("colliding", {**given, "common": {"dynamics": name, "duration": 0.1}}))
        for name in ("compiled", "pinocchio")
    )
    assert np.abs(found.joint_position - theirs.joint_position).max() < 1e-13
    assert np.count_nonzero(found.joint_effort[1:] != found.joint_command[:-1])


@pytest.mark.parametrize("scheme", TABLEAUS)
@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_ticks_in_c_are_those_of_python(law: str, scheme: str) -> None:
    """Bit for bit, with saturated motors, a moving reference, one that grows old, and an unlike truth."""
    values = {
        "law": law,
        **{"common.dynamics": "compiled", "plant.integrator": scheme, "trajectory.time_law": "quintic"},
        **{"robot.arms.arm_a.limits.joint_2.effort": 0.02, "truth.robot.base.mass": 260.0},
        **{"controller.reference_hold": 0.0, "model.robot.arms.arm_b.limits.joint_1.effort": 0.01},
    }
    scenario = load_scenario(values=values)
    common, parameters = scenario.parameters.common, scenario.parameters
    ends = []
    for compiled in (True, False):
        plant = make_plant(scenario.truth.robot, scenario.truth.schedule, common, parameters.plant)
        known = scenario.model
        controller = make_controller(known.robot, known.schedule, common, parameters.controller)
        runner = make_runner(plant, controller, known.robot, common, parameters.plant)
        assert isinstance(runner, CompiledTicks)
        used = runner if compiled else PythonRunner(plant, controller)
        rows = []
        for index in range(3):
            velocity = 0.3 * np.cos(np.arange(known.robot.n_joints) + index)
            position = plant.q[BASE_NQ:] + 0.1 * velocity
            reference = JointReference(plant.stamp_ns, position, velocity)
            controller.guide(Guidance(TaskPhase(plant.stamp_ns, index, ""), reference, {}))
            rows.append(used.run(40, 40 if index < 2 else 39))
        ends.append((rows, plant.snapshot(), controller_data(controller, law)))
    (ours, plant_state, memory), (theirs, their_state, their_memory) = ends
    for one, other in zip(ours, theirs, strict=True):
        for field in ("stamp_ns", "q", "v", "joint_effort", "effort"):
            assert getattr(one, field).tobytes() == getattr(other, field).tobytes(), field
    assert plain(plant_state) == plain(their_state) and memory == their_memory
    assert sum(plant_state.saturated_ticks) > 0


def test_another_kind_of_dynamics_is_unknown() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'compiled'"):
        load_scenario("colliding", {"common": {"dynamics": "compield"}})


def test_the_linearisation_is_that_of_pinocchio(draw: Draw, monkeypatch: pytest.MonkeyPatch) -> None:
    """Derivatives of momentum and efforts to 1e-12, with momentum; and a run that asks for them has them."""
    robot = load_scenario("planar").model.robot
    ours, theirs = CompiledDerivatives(robot), PinocchioDerivatives(robot)
    for _ in range(10):
        joints, v = draw.random.uniform(-3.0, 3.0, robot.n_joints), draw.random.normal(size=robot.pin.nv)
        q, a = robot.configuration(draw.pose(), joints), draw.random.normal(size=robot.n_joints)
        mass, _ = mass_matrix(robot, robot.pin.createData(), q)
        found, expected = ours.at(q, v, a, mass), theirs.at(q, v, a, mass)
        pairs = [(getattr(found, part.name), getattr(expected, part.name)) for part in fields(found)]
        for one, other in (*pairs, (ours.momentum(q, v), theirs.momentum(q, v))):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=_ROUNDING * np.abs(other).max())
    calls, call = list[Array](), CompiledDerivatives.at

    def counted(self: CompiledDerivatives, q: Array, v: Array, a: Array, mass: MassMatrix) -> Any:
        calls.append(q)
        return call(self, q, v, a, mass)

    monkeypatch.setattr(CompiledDerivatives, "at", counted)
    values = {"common.duration": 0.3, "common.tick": 0.01, "law": "mpc"}
    by_pinocchio = simulate(load_scenario("planar", values)).joint_velocity
    assert not calls
    compiled = simulate(load_scenario("planar", {**values, "controller.linearisation": "compiled"}))
    assert len(calls) > 100 and np.abs(by_pinocchio).max() > 1e-3
    np.testing.assert_allclose(compiled.joint_velocity, by_pinocchio, rtol=0.0, atol=1e-9)
