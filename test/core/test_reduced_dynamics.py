"""Eliminating the base gives the same arms as the full equations, and the base its share at zero momentum."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.poses import pose_distance
from sms_handover.model.reduced import (
    base_twist_per_joint_rate,
    generalized_jacobian,
    reduced_dynamics,
    reduced_inverse_dynamics,
    tool_jacobian,
)
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, Pose

from .conftest import FD_BOUND, FD_STEP, Draw

_EPS = np.finfo(float).eps


def _rounding(robot: RobotModel, q: Array) -> float:
    """Return the relative rounding of a solve with the whole mass matrix: n eps cond(H)."""
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)
    return float(robot.pin.nv * _EPS * np.linalg.cond(inertia))


def _tool_rate(robot: RobotModel, q: Array, v: Array, arm: str) -> Array:
    """Return the twist (6,) of a tool in ``world`` axes by differences of its pose along v."""
    ends = []
    for time in (-FD_STEP, FD_STEP):
        moved = pin.integrate(robot.pin, q, time * v)
        tool = robot.tools_in_world(Pose(moved[:3], moved[3:BASE_NQ]), moved[BASE_NQ:])[arm]
        ends.append(pin.SE3(pin.Quaternion(tool.quaternion_xyzw), tool.position))
    linear = (ends[1].translation - ends[0].translation) / (2.0 * FD_STEP)
    angular = pin.log3(ends[1].rotation @ ends[0].rotation.T) / (2.0 * FD_STEP)
    return np.concatenate([linear, angular])


def test_joint_accelerations_equal_those_of_the_full_robot(robot: RobotModel, draw: Draw) -> None:
    """H* q_m'' + c* = u has the joint accelerations of all 20 degrees of freedom with nothing on the base."""
    for _ in range(20):
        q, v, effort = draw.q(), draw.v(), draw.vector(14, 5.0)
        full = pin.aba(robot.pin, robot.data, q, v, np.concatenate([np.zeros(BASE_NV), effort]))[BASE_NV:]
        reduced = reduced_dynamics(robot, q, v)
        acceleration = np.linalg.solve(reduced.inertia, effort - reduced.bias)
        bound = _rounding(robot, q) * float(np.linalg.norm(full))
        np.testing.assert_allclose(acceleration, full, atol=bound)


def test_inverse_dynamics_brings_about_the_accelerations_asked_for(robot: RobotModel, draw: Draw) -> None:
    """The efforts found for joint accelerations give the full robot, base free, just these."""
    for _ in range(20):
        q, v, wanted = draw.q(), draw.v(), draw.vector(14, 5.0)
        effort = reduced_inverse_dynamics(robot, q, v, wanted)
        found = pin.aba(robot.pin, robot.data, q, v, np.concatenate([np.zeros(BASE_NV), effort]))[BASE_NV:]
        scale = float(np.linalg.norm(wanted) + np.linalg.norm(v) ** 2)
        np.testing.assert_allclose(found, wanted, atol=_rounding(robot, q) * scale)


def test_reduced_inertia_is_that_of_a_mechanism(robot: RobotModel, draw: Draw) -> None:
    """H* is symmetric and positive definite, and with the base held no direction is lighter."""
    for _ in range(20):
        q = draw.q()
        inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
        held = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)[BASE_NV:, BASE_NV:]
        rounding = 20 * _EPS * float(np.linalg.norm(held))
        np.testing.assert_allclose(inertia, inertia.T, atol=rounding)
        assert np.min(np.linalg.eigvalsh(inertia)) > 0.0
        assert np.min(np.linalg.eigvalsh(held - inertia)) >= -rounding


def test_there_is_no_bias_at_rest(robot: RobotModel, draw: Draw) -> None:
    """Nothing pushes a robot that stands still, and velocity terms grow with the square of the velocity."""
    q, v = draw.q(), draw.v()
    at_rest = reduced_dynamics(robot, q, np.zeros(20)).bias
    once, twice = (reduced_dynamics(robot, q, scale * v).bias for scale in (1.0, 2.0))
    rounding = 254.0 * 20 * _EPS
    np.testing.assert_allclose(at_rest, 0.0, atol=rounding)
    np.testing.assert_allclose(twice, 4.0 * once, atol=10 * rounding)


def test_base_motion_at_zero_momentum(robot: RobotModel, draw: Draw) -> None:
    """With the base twist that the joint rates ask for, both momenta vanish and H* holds all the energy."""
    for _ in range(20):
        q, rates = draw.q(), draw.vector(14)
        v = np.concatenate([base_twist_per_joint_rate(robot, q) @ rates, rates])
        conserved = conserved_quantities(robot, q, v)
        rounding = _rounding(robot, q) * 254.0
        np.testing.assert_allclose(conserved.linear_momentum, 0.0, atol=rounding)
        np.testing.assert_allclose(conserved.angular_momentum, 0.0, atol=rounding)
        energy = 0.5 * rates @ reduced_dynamics(robot, q, v).inertia @ rates
        assert conserved.kinetic_energy == pytest.approx(energy, rel=_rounding(robot, q))


def test_base_reaction_depends_on_the_joints_only(robot: RobotModel, draw: Draw) -> None:
    """In the axes of the base its reaction is the same wherever it floats."""
    joints = draw.joints()
    here, there = (robot.configuration(draw.pose(), joints) for _ in range(2))
    np.testing.assert_allclose(
        base_twist_per_joint_rate(robot, here),
        base_twist_per_joint_rate(robot, there),
        atol=_rounding(robot, here),
    )


@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_tool_jacobian_is_the_derivative_of_the_tool_pose(robot: RobotModel, draw: Draw, arm: str) -> None:
    """Column by column: moving one degree of freedom moves and turns the tool as its column says."""
    q = draw.q()
    jacobian = tool_jacobian(robot, q, arm)
    for column, direction in enumerate(np.eye(20)):
        np.testing.assert_allclose(jacobian[:, column], _tool_rate(robot, q, direction, arm), atol=FD_BOUND)


@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_generalised_jacobian_along_zero_momentum_motion(robot: RobotModel, draw: Draw, arm: str) -> None:
    """J* gives the twist of the tool that is seen when the joints move and the base gives way freely."""
    q = draw.q()
    jacobian = generalized_jacobian(robot, q, arm)
    reaction = base_twist_per_joint_rate(robot, q)
    for column, direction in enumerate(np.eye(14)):
        v = np.concatenate([reaction @ direction, direction])
        np.testing.assert_allclose(jacobian[:, column], _tool_rate(robot, q, v, arm), atol=FD_BOUND)


def test_generalised_jacobian_of_a_heavy_base_is_the_ordinary_one(robot: RobotModel, draw: Draw) -> None:
    """The heavier the base, the less it gives way: J* tends to the Jacobian of the arm alone, as 1 / mass."""
    q = draw.q()
    fixed = tool_jacobian(robot, q, "arm_a")[:, BASE_NV:]
    apart = []
    for factor in (1e3, 1e4):
        heavy = RobotModel(robot.description)
        base = heavy.pin.inertias[1]
        heavy.pin.inertias[1] = pin.Inertia(factor * base.mass, base.lever, factor * base.inertia)
        apart.append(float(np.max(np.abs(generalized_jacobian(heavy, q, "arm_a") - fixed))))
    # The next term of the series is smaller by the arms' share of the mass, which is below 1 / 1000.
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.01)


def test_a_closed_joint_path_turns_the_base(robot: RobotModel, draw: Draw) -> None:
    """Joints that come back have turned the base, by an angle that belongs to the path, not to the step."""
    start = draw.joints(margin=0.5)
    corners = [start, start + 0.4 * np.eye(14)[1], start + 0.4 * (np.eye(14)[1] + np.eye(14)[3]),
               start + 0.4 * np.eye(14)[3], start]  # fmt: skip
    angles = []
    for steps in (8, 16, 32, 64):
        pose = origin = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        for begin, end in pairwise(corners):
            stride = (end - begin) / steps
            for index in range(steps):
                q = robot.configuration(origin, begin + (index + 0.5) * stride)
                pose = robot.integrate_base(pose, base_twist_per_joint_rate(robot, q) @ stride, 1.0)
        angles.append(pose_distance(origin, pose)[1])
    differences = np.abs(np.diff(angles))
    assert angles[-1] > 1e-4  # [rad] about the area of the path, 0.16 rad^2, times the arm's share of inertia
    np.testing.assert_allclose(differences[:-1] / differences[1:], 4.0, rtol=0.1)  # midpoint rule: order 2
