"""Compiled kinematics and inverse kinematics: the values of Pinocchio to rounding, the same iterations."""

import ctypes
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.inverse_kinematics import CompiledIk
from sms_handover.compiled.kinematics import CompiledKinematics
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.tool_motion import CompiledToolMotion
from sms_handover.ik.levenberg_marquardt import Solution, find_joints
from sms_handover.model.description import load_robot
from sms_handover.model.poses import pose_distance
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.plant.kinematics import PinocchioKinematics
from sms_handover.simulation import loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_ik
from sms_handover.trajectory.time_law import Progress
from sms_handover.trajectory.tool_motion import PinocchioToolMotion
from sms_handover.types import Array, IkRequest, IkStatus, Pose, Twist

from .conftest import Draw
from .robots import someone_else

_ROUNDING = 1e-13  # [m, rad, m/s, rad/s, kg m/s, J] ten frames of a dozen operations
_ANGLE = 1e-10  # [rad] of inverse kinematics: rounding, and what the last iterations make of it
_FAR = Pose(np.array([9.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))

pytestmark = pytest.mark.usefixtures("kept_libraries")


def _one_armed() -> RobotModel:
    description = load_robot()
    return RobotModel(replace(description, arms=description.arms[:1]))


@pytest.mark.parametrize(
    "make", [RobotModel.load, lambda: RobotModel(someone_else(load_robot(), seed=6)), _one_armed]
)
def test_tools_deputy_and_momenta_are_those_of_pinocchio(make: Callable[[], RobotModel]) -> None:
    robot = make()
    draw = Draw(robot, seed=8)
    ours, theirs = CompiledKinematics(robot), PinocchioKinematics(robot)
    for _ in range(20):
        q, v, held = draw.q(), draw.v(), draw.pose()
        poses = theirs.tools_at(q)
        for arm, pose in ours.tools_at(q).items():
            assert max(pose_distance(pose, poses[arm])) < _ROUNDING
            (at, twist), (their_at, their_twist) = (k.tool_motion(q, v, arm) for k in (ours, theirs))
            assert max(pose_distance(at, their_at)) < _ROUNDING
            assert twist.linear == pytest.approx(their_twist.linear, abs=_ROUNDING)
            assert twist.angular == pytest.approx(their_twist.angular, abs=_ROUNDING)
        found, expected = ours.conserved(q, v), theirs.conserved(q, v)
        scale = float(robot.mass)
        assert found.linear_momentum == pytest.approx(expected.linear_momentum, abs=scale * _ROUNDING)
        assert found.angular_momentum == pytest.approx(expected.angular_momentum, abs=10 * scale * _ROUNDING)
        assert found.centre_of_mass == pytest.approx(expected.centre_of_mass, abs=_ROUNDING)
        assert found.kinetic_energy == pytest.approx(expected.kinetic_energy, rel=1e-12)
        deputies = [MasslessDeputy(held, {}) for _ in range(2)]
        for deputy in deputies:
            deputy.attach(robot.arms[-1], poses[robot.arms[-1]])
        ours.carry(deputies[0], q, v)
        theirs.carry(deputies[1], q, v)
        one, other = (deputy.state for deputy in deputies)
        assert max(pose_distance(one.deputy_in_world, other.deputy_in_world)) < 10 * _ROUNDING
        assert one.twist_deputy_in_world.linear == pytest.approx(
            other.twist_deputy_in_world.linear, abs=10 * _ROUNDING
        )


def test_paths_and_rates_of_tools_are_those_of_pinocchio(robot: RobotModel) -> None:
    """From small turns to nearly half a one; one arm led, or both, with the other one in motion."""
    draw = Draw(robot, seed=10)
    ours, theirs = CompiledToolMotion(robot), PinocchioToolMotion(robot)
    for distance in (1e-9, 1e-3, 0.1, 1.0, 1.7):
        start = draw.pose()
        goal = draw.near(start, distance)
        for progress in (Progress(0.0, 0.0), Progress(0.3, 0.7), Progress(1.0, 0.0)):
            (pose, twist), (expected, their_twist) = (
                m.on_path(start, goal, progress) for m in (ours, theirs)
            )
            assert max(pose_distance(pose, expected)) < 10 * _ROUNDING
            assert twist.linear == pytest.approx(their_twist.linear, abs=10 * _ROUNDING)
            assert twist.angular == pytest.approx(their_twist.angular, abs=10 * _ROUNDING)
        q, velocity = draw.q(), draw.vector(robot.n_joints, 0.1)
        twists = {arm: Twist(draw.vector(3, 0.1), draw.vector(3, 0.1)) for arm in robot.arms}
        for led in (robot.arms, robot.arms[1:]):
            wanted = {arm: twists[arm] for arm in led}
            found, rates = (m.resolved(q, wanted, velocity, 0.05) for m in (ours, theirs))
            assert found == pytest.approx(rates, abs=1e-11)
            others = np.ones(robot.n_joints, dtype=bool)
            for arm in led:
                others[robot.arm_joints[arm]] = False
            assert np.array_equal(found[others], velocity[others])


def test_sine_and_cosine_are_right_to_the_last_digit(robot: RobotModel) -> None:
    """Within one unit in the last place, against the longer numbers of the processor."""
    random = np.random.default_rng(11)
    quarters = np.pi / 2 * np.arange(-64, 65)
    parts = [random.uniform(-reach, reach, 20_000) for reach in (1e-3, 1.0, 10.0, 1e5)]
    x = np.concatenate([*parts, quarters, np.nextafter(quarters, 9.0), [0.0, -0.0, 5e-324, 1e-200]])
    sines, cosines = np.empty_like(x), np.empty_like(x)
    kinds = [*[ctypes.c_void_p] * 3, ctypes.c_long]
    function = NativeFunction(dynamics_library(robot), "sms_sines_cosines", kinds)
    function(*(array.ctypes.data for array in (x, sines, cosines)), len(x))
    assert np.finfo(np.longdouble).nmant > 60
    for found, exact in (
        (sines, np.sin(x.astype(np.longdouble))),
        (cosines, np.cos(x.astype(np.longdouble))),
    ):
        assert (np.abs(found - exact) <= 0.85 * np.spacing(np.abs(exact).astype(np.float64))).all()
    odd = np.array([np.nan, np.inf, 1e300])
    function(*(array.ctypes.data for array in (odd, sines, cosines)), len(odd))
    assert np.isnan(sines[:2]).all() and np.isnan(cosines[:2]).all()


def _same(one: Solution, other: Solution) -> None:
    assert (one.status, one.iterations) == (other.status, other.iterations)
    assert np.abs(one.joint_position - other.joint_position).max() < _ANGLE
    assert one.residual.values == pytest.approx(other.residual.values, abs=_ANGLE)


@pytest.mark.parametrize("time_law", ["step", "quintic"])
def test_inverse_kinematics_of_a_task_goes_the_same_way(
    time_law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On what a run asks for, the first seconds after each target has changed."""
    requests: list[IkRequest] = []
    make = make_ik

    def recording(*arguments: object) -> Callable[[IkRequest], Solution]:
        find = make(*arguments)  # type: ignore[arg-type]

        def found(request: IkRequest) -> Solution:
            requests.append(request)
            return find(request)

        return found

    monkeypatch.setattr(loop, "make_ik", recording)
    short: dict[str, object] = {}
    for name in ("approach", "carry", "withdraw"):
        short |= {f"schedule.phases.{name}.duration": 2.0, f"schedule.phases.{name}.motion": 1.5}
    scenario = load_scenario(values={"trajectory.time_law": time_law, **short})
    simulate(scenario)
    robot, parameters = scenario.model.robot, scenario.parameters.ik
    find = CompiledIk(robot, parameters)
    assert len(requests) > 200
    for request in requests:
        _same(find(request), find_joints(robot, request, parameters))


def test_inverse_kinematics_from_far_away(robot: RobotModel) -> None:
    """Through half turns, limits and the iteration limit; also for one arm, for none, and out of reach."""
    draw = Draw(robot, seed=9)
    parameters = load_scenario().parameters.ik
    statuses = set()
    for most in (3, 200):
        settings = replace(parameters, max_iterations=most)
        find = CompiledIk(robot, settings)
        for index in range(12):
            base, tools = draw.pose(), robot.tools_in_world(draw.pose(), draw.joints())
            targets: dict[str, Pose] = [tools, {"arm_b": tools["arm_b"]}, {}, {"arm_a": _FAR}][index % 4]
            request = IkRequest(base, draw.joints(), targets)
            found, expected = find(request), find_joints(robot, request, settings)
            statuses.add(found.status)
            assert found.status is expected.status or found.iterations > 20
            if found.iterations < 20:  # rounding grows on long ways
                _same(found, expected)
    assert statuses == set(IkStatus)


def test_inverse_kinematics_without_numbers(robot: RobotModel) -> None:
    parameters = load_scenario().parameters.ik
    nowhere = Pose(np.array([np.nan, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    base: Pose = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    seed: Array = np.zeros(robot.n_joints)
    request = IkRequest(base, seed, {"arm_a": nowhere})
    found, expected = CompiledIk(robot, parameters)(request), find_joints(robot, request, parameters)
    assert (found.status, found.iterations) == (expected.status, expected.iterations)
    assert np.array_equal(found.joint_position, expected.joint_position)
