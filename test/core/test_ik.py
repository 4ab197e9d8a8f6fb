"""Inverse kinematics meets the targets it can, says when it cannot, and never leaves the joint limits."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.ik.parameters import IkParameters
from sms_handover.ik.residual import PoseResidual, manipulability
from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.model.reduced import tool_jacobian
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array, IkRequest, IkResult, IkStatus, Pose

from .conftest import FD_BOUND, FD_STEP, Draw

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS
_HOME = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


@pytest.fixture
def parameters() -> IkParameters:
    """Tolerances of a micrometre and a microradian."""
    return IkParameters(
        position_tolerance=1e-6,
        orientation_tolerance=1e-6,
        damping_bias=1e-6,
        max_iterations=100,
        stall_step=1e-10,
    )


def _errors(
    robot: RobotModel, base: Pose, result: IkResult, targets: Mapping[str, Pose]
) -> tuple[float, float]:
    """Return the largest errors of the tools, by forward kinematics."""
    tools = robot.tools_in_world(base, result.joint_position)
    pairs = [pose_distance(tools[arm], target) for arm, target in targets.items()]
    return max(pair[0] for pair in pairs), max(pair[1] for pair in pairs)


def _within_limits(robot: RobotModel, joints: Array) -> bool:
    """Whether no joint is beyond a limit, not even by rounding."""
    return bool(np.all(joints >= robot.lower) and np.all(joints <= robot.upper))


# --- residual ------------------------------------------------------------------------------------


def test_residual_is_the_error_of_the_pose(robot: RobotModel, draw: Draw) -> None:
    """Its norms are the distance and the angle between tool and target."""
    base, joints = draw.pose(), draw.joints()
    targets = {arm: draw.near(tool, 0.5) for arm, tool in robot.tools_in_world(base, joints).items()}
    residual = PoseResidual(robot, base, targets).evaluate(joints)
    tools = robot.tools_in_world(base, joints)
    errors = [pose_distance(tools[arm], targets[arm]) for arm in targets]
    assert residual.position_error == pytest.approx(max(e[0] for e in errors), abs=_ROUNDING)
    assert residual.orientation_error == pytest.approx(max(e[1] for e in errors), abs=_ROUNDING)
    energy = 0.5 * sum(position**2 + angle**2 for position, angle in errors)
    assert residual.energy == pytest.approx(energy, abs=4 * _ROUNDING)


@pytest.mark.parametrize("far", [0.01, 0.3, 1.0])
def test_jacobian_is_the_derivative_of_the_residual(robot: RobotModel, draw: Draw, far: float) -> None:
    """Joint by joint, near the target and up to 1.7 rad away from it, for both arms at once."""
    base, joints = draw.pose(), draw.joints()
    targets = {arm: draw.near(tool, far) for arm, tool in robot.tools_in_world(base, joints).items()}
    problem = PoseResidual(robot, base, targets)
    jacobian = problem.jacobian(joints)
    for column, direction in enumerate(np.eye(14)):
        ahead, behind = (problem.evaluate(joints + side * FD_STEP * direction).values for side in (1.0, -1.0))
        np.testing.assert_allclose(jacobian[:, column], (ahead - behind) / (2 * FD_STEP), atol=FD_BOUND)


def test_manipulability_is_the_volume_of_the_velocity_ellipsoid(robot: RobotModel, draw: Draw) -> None:
    """It is the product of the singular values of the arm's Jacobian, in whatever axes."""
    base, joints = draw.pose(), draw.joints()
    q = robot.configuration(base, joints)
    found = manipulability(robot, joints)
    for index, (arm, part) in enumerate(robot.arm_joints.items()):
        columns = slice(BASE_NV + part.start, BASE_NV + part.stop)
        values = np.linalg.svd(tool_jacobian(robot, q, arm)[:, columns], compute_uv=False)
        # det(J J^T) is known to eps times the largest singular value to the twelfth
        assert found[index] ** 2 == pytest.approx(np.prod(values) ** 2, abs=6**3 * _EPS * values[0] ** 12)


def test_a_stretched_arm_has_no_manipulability(robot: RobotModel) -> None:
    """With every joint at zero the arm is straight and cannot move along itself."""
    stretched = manipulability(robot, np.zeros(14))
    bent = manipulability(robot, np.tile([0.0, -0.5, 0.0, -1.7, 0.0, -0.6, 0.0], 2))
    # the square root of a determinant that is rounding: eps times singular values below 3
    assert np.all(stretched <= np.sqrt(6**3 * _EPS * 3.0**12))
    assert np.all(bent > 1e-3)


# --- solving -------------------------------------------------------------------------------------


def test_a_near_target_is_met(robot: RobotModel, draw: Draw, parameters: IkParameters) -> None:
    """From within 0.05 rad, as in a run, nearly every target is met in a few iterations.

    Whatever is called converged is met by forward kinematics, and the figures of the result are true.
    Measured for this arm with these tolerances: 99.3 % of such solves converge.
    """
    converged, iterations = 0, []
    for _ in range(200):
        base, joints = draw.pose(), draw.joints(margin=0.05)
        targets = robot.tools_in_world(base, joints)
        seed = joints + draw.vector(14, 0.05)
        result = solve_ik(robot, IkRequest(base, seed, targets), parameters)
        position, angle = _errors(robot, base, result, targets)
        assert _within_limits(robot, result.joint_position)
        assert result.position_error == pytest.approx(position, abs=_ROUNDING)
        assert result.orientation_error == pytest.approx(angle, abs=_ROUNDING)
        if result.status is IkStatus.CONVERGED:
            assert max(position, angle) <= 1e-6
            converged += 1
            iterations.append(result.iterations)
    assert converged >= 0.99 * 200
    assert np.median(iterations) <= 5


def test_random_targets_are_met_from_random_seeds(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """With up to ten seeds almost every reachable pose of an arm is met, far from any start."""
    met = 0
    for _ in range(60):
        base = draw.pose()
        target = {"arm_a": robot.tools_in_world(base, draw.joints())["arm_a"]}
        for _ in range(10):
            result = solve_ik(robot, IkRequest(base, draw.joints(), target), parameters)
            assert _within_limits(robot, result.joint_position)
            if result.status is IkStatus.CONVERGED:
                assert max(_errors(robot, base, result, target)) <= 1e-6
                met += 1
                break
    assert met >= 59  # 99.8 % were measured: more than one miss in 60 has a chance below 1 %


def test_a_solved_seed_is_kept(robot: RobotModel, draw: Draw, parameters: IkParameters) -> None:
    """A robot already there does not move: no iteration, the seed itself."""
    base, joints = draw.pose(), draw.joints()
    request = IkRequest(base, joints, robot.tools_in_world(base, joints))
    result = solve_ik(robot, request, parameters)
    assert (result.status, result.iterations, result.seed_distance) == (IkStatus.CONVERGED, 0, 0.0)
    np.testing.assert_array_equal(result.joint_position, joints)


@pytest.mark.parametrize(("led", "other"), [("arm_a", "arm_b"), ("arm_b", "arm_a")])
def test_an_arm_without_target_keeps_its_seed(
    robot: RobotModel, draw: Draw, parameters: IkParameters, led: str, other: str
) -> None:
    """Bit for bit, while the arm with a target moves."""
    base, joints = draw.pose(), draw.joints(margin=0.3)
    target = {led: robot.tools_in_world(base, joints + draw.vector(14, 0.2))[led]}
    result = solve_ik(robot, IkRequest(base, joints, target), parameters)
    assert result.status is IkStatus.CONVERGED
    np.testing.assert_array_equal(
        result.joint_position[robot.arm_joints[other]], joints[robot.arm_joints[other]]
    )
    assert result.seed_distance == np.max(np.abs(result.joint_position - joints)) > 0.0


def test_without_targets_the_seed_is_the_answer(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """Nothing is asked, so nothing moves and nothing is wrong."""
    joints = draw.joints()
    result = solve_ik(robot, IkRequest(draw.pose(), joints, {}), parameters)
    assert (result.status, result.position_error, result.orientation_error) == (IkStatus.CONVERGED, 0.0, 0.0)
    np.testing.assert_array_equal(result.joint_position, joints)


def test_the_answer_does_not_depend_on_where_the_robot_is(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """Moving base and target together leaves the joint angles as they are."""
    joints = draw.joints(margin=0.3)
    target = robot.tools_in_world(_HOME, joints + draw.vector(14, 0.1))
    here = solve_ik(robot, IkRequest(_HOME, joints, target), parameters)
    base = draw.pose(reach=3.0)
    moved = {arm: pose_of(se3_of(base) * se3_of(pose)) for arm, pose in target.items()}
    there = solve_ik(robot, IkRequest(base, joints, moved), parameters)
    assert here.status is there.status is IkStatus.CONVERGED
    # rounding of the residual, through the inverse of a Jacobian whose smallest singular value is above 0.01
    np.testing.assert_allclose(there.joint_position, here.joint_position, atol=100 * 10 * _ROUNDING)


def test_a_target_at_a_joint_limit_is_met(robot: RobotModel, draw: Draw, parameters: IkParameters) -> None:
    """With a joint at its limit the others make up for it, and the limit margin says so."""
    joints = draw.joints(margin=0.3)
    joints[3] = robot.upper[3]
    targets = robot.tools_in_world(_HOME, joints)
    seed = np.clip(joints + draw.vector(14, 0.05), robot.lower, robot.upper)
    result = solve_ik(robot, IkRequest(_HOME, seed, targets), parameters)
    assert result.status is IkStatus.CONVERGED
    assert _within_limits(robot, result.joint_position)
    margin = np.min(np.minimum(result.joint_position - robot.lower, robot.upper - result.joint_position))
    assert result.limit_margin == margin


def test_a_seed_outside_its_limits_is_brought_inside(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """A joint that has run through its limit is led back inside; the distance counts from the seed."""
    joints = draw.joints(margin=0.3)
    seed = np.array(joints)
    seed[1] = robot.upper[1] + 0.1
    for targets in ({}, robot.tools_in_world(_HOME, joints)):
        result = solve_ik(robot, IkRequest(_HOME, seed, targets), parameters)
        assert _within_limits(robot, result.joint_position)
        assert result.seed_distance >= 0.1 - _EPS


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.48, 0.64, 0.6), (0.6, 0.0, -0.8)])
def test_an_unreachable_target_is_approached_as_near_as_can_be(
    robot: RobotModel, draw: Draw, parameters: IkParameters, direction: tuple[float, float, float]
) -> None:
    """The status says so, the limits hold, and no configuration found at random comes nearer."""
    target = Pose(robot.tools_in_world(_HOME, np.zeros(14))["arm_a"].position + 2.0 * np.array(direction),
                  np.array([0.0, 0.0, 0.0, 1.0]))  # fmt: skip
    problem = PoseResidual(robot, _HOME, {"arm_a": target})
    seeds = [np.tile([0.0, -0.5, 0.0, -1.7, 0.0, -0.6, 0.0], 2)] + [draw.joints() for _ in range(4)]
    results = [solve_ik(robot, IkRequest(_HOME, seed, {"arm_a": target}), parameters) for seed in seeds]
    for result in results:
        assert result.status in (IkStatus.STALLED, IkStatus.ITERATION_LIMIT)
        assert _within_limits(robot, result.joint_position)
        assert result.position_error > 1.0 - 0.1  # [m] 2 m beyond a stretched arm, less what it can lean
    best = min(result.position_error**2 + result.orientation_error**2 for result in results)
    sampled = min(float(np.sum(problem.evaluate(draw.joints()).values ** 2)) for _ in range(5000))
    assert best <= sampled


def test_a_stalled_solve_is_at_a_minimum_within_the_limits(robot: RobotModel, draw: Draw) -> None:
    """Free joints have no slope left; joints at a limit are those that the slope pushes against it.

    The last step was below the stall step, and the slope is the damped curvature times that step.
    """
    patient = IkParameters(1e-6, 1e-6, damping_bias=1e-6, max_iterations=5000, stall_step=1e-5)
    stalled = at_limits = 0
    for _ in range(12):
        way = draw.vector(3)
        far = Pose(3.0 * way / np.linalg.norm(way), draw.pose().quaternion_xyzw)
        result = solve_ik(robot, IkRequest(_HOME, draw.joints(), {"arm_a": far}), patient)
        if result.status is IkStatus.ITERATION_LIMIT:
            continue  # a stretched arm comes nearer for ever, ever more slowly
        assert (result.status, result.iterations < 5000) == (IkStatus.STALLED, True)
        stalled += 1
        joints = result.joint_position
        problem = PoseResidual(robot, _HOME, {"arm_a": far})
        residual, jacobian = problem.evaluate(joints), problem.jacobian(joints)
        slope = jacobian.T @ residual.values
        held = ((joints <= robot.lower) & (slope > 0)) | ((joints >= robot.upper) & (slope < 0))
        curvature = float(np.linalg.norm(jacobian, 2)) ** 2 + residual.energy + 1e-6
        assert np.max(np.abs(slope[~held])) <= curvature * np.sqrt(14) * 1e-5
        at_limits += int(np.any(held))
    assert stalled >= at_limits > 0


@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_what_is_no_number_is_not_called_converged(
    robot: RobotModel, draw: Draw, parameters: IkParameters, arm: str
) -> None:
    """One joint whose angle is unknown, in either arm, while both tools were at their targets."""
    base, joints = draw.pose(), draw.joints()
    targets = robot.tools_in_world(base, joints)
    joints[robot.arm_joints[arm].start] = np.nan
    with np.errstate(invalid="ignore"):
        result = solve_ik(robot, IkRequest(base, joints, targets), parameters)
    assert result.status is not IkStatus.CONVERGED


def test_the_iteration_limit_is_kept_and_said(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """With one iteration allowed a far target cannot be met, but the answer is nearer than the seed."""
    base, seed = draw.pose(), draw.joints(margin=0.3)
    targets = robot.tools_in_world(base, seed + 0.3)
    short = solve_ik(robot, IkRequest(base, seed, targets), replace(parameters, max_iterations=1))
    assert (short.status, short.iterations) == (IkStatus.ITERATION_LIMIT, 1)
    problem = PoseResidual(robot, base, targets)
    assert problem.evaluate(short.joint_position).energy < problem.evaluate(seed).energy


def test_error_falls_with_every_iteration(robot: RobotModel, draw: Draw, parameters: IkParameters) -> None:
    """No step is taken that does not lower the error, not even where the full step would overshoot."""
    one_step = replace(parameters, max_iterations=1)
    for _ in range(40):
        base, joints = draw.pose(), draw.joints()
        targets = robot.tools_in_world(base, draw.joints())
        problem = PoseResidual(robot, base, targets)
        energies = [problem.evaluate(joints).energy]
        for _ in range(15):
            joints = solve_ik(robot, IkRequest(base, joints, targets), one_step).joint_position
            energies.append(problem.evaluate(joints).energy)
        assert all(later <= earlier for earlier, later in pairwise(energies))


def test_the_same_request_has_the_same_answer(
    robot: RobotModel, draw: Draw, parameters: IkParameters
) -> None:
    """Bit for bit, whatever was solved in between."""
    base, seed = draw.pose(), draw.joints()
    request = IkRequest(base, seed, robot.tools_in_world(base, draw.joints()))
    first = solve_ik(robot, request, parameters)
    solve_ik(robot, IkRequest(draw.pose(), draw.joints(), request.tool_in_world), parameters)
    again = solve_ik(robot, request, parameters)
    np.testing.assert_array_equal(first.joint_position, again.joint_position)
    assert (first.iterations, first.status) == (again.iterations, again.status)


def test_convergence_is_quadratic_near_a_regular_target(robot: RobotModel, draw: Draw) -> None:
    """Damping by the error itself vanishes at the solution, so the error squares with every step."""
    exact = IkParameters(1e-12, 1e-12, damping_bias=0.0, max_iterations=1, stall_step=0.0)
    joints = np.tile([0.3, -0.7, 0.2, -1.5, 0.4, -0.9, 0.1], 2)
    targets = robot.tools_in_world(_HOME, joints)
    problem = PoseResidual(robot, _HOME, targets)
    request = IkRequest(_HOME, joints + draw.vector(14, 0.05), targets)
    results = [solve_ik(robot, request, replace(exact, max_iterations=count)) for count in (1, 2, 3)]
    errors = [np.sqrt(2.0 * problem.evaluate(result.joint_position).energy) for result in results]
    assert errors[0] < 0.01
    assert errors[1] < errors[0] ** 1.5 and errors[2] < errors[1] ** 1.5  # a linear rate has exponent 1
