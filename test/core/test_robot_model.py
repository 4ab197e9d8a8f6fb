"""The floating robot against kinematics and momenta summed over its bodies, with no code of Pinocchio."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.errors import UnknownNameError
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.parts import Inertia, Origin
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, Pose

from .conftest import FD_BOUND, FD_STEP, Draw, state_of

# Each pose is a product of 10 rotations of a dozen operations on numbers below 3.
_ROUNDING = 10 * 12 * 3.0 * np.finfo(float).eps


class Body(NamedTuple):
    """A rigid body at one configuration: mass, centre of mass, inertia about it, all in ``world``."""

    mass: float
    centre: Array
    rotation: Array
    moments: Array


def _cross(a: Array) -> Array:
    """Return the matrix of the cross product with a vector."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _rotation(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit axis, by Rodrigues' formula."""
    k = _cross(axis)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)


def _homogeneous(rotation: Array, translation: Array) -> Array:
    """Return a (4, 4) transformation."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def _placement(origin: Origin) -> Array:
    """Return the transformation of an origin."""
    rotation = np.eye(3)
    for axis, angle in zip(np.eye(3), origin.rpy, strict=True):
        rotation = _rotation(axis, angle) @ rotation
    return _homogeneous(rotation, np.array(origin.xyz))


def _base(q: Array) -> Array:
    """Return the transformation of the base, from the textbook matrix of a quaternion x y z w."""
    vector, w = q[3:6], q[6]
    rotation = (w * w - vector @ vector) * np.eye(3) + 2.0 * np.outer(vector, vector)
    return _homogeneous(rotation + 2.0 * w * _cross(vector), q[:3])


def _body(inertia: Inertia, frame: Array) -> Body:
    """Return a body whose frame is placed in ``world``."""
    centre = frame[:3, :3] @ np.array(inertia.com) + frame[:3, 3]
    return Body(inertia.mass, centre, frame[:3, :3], inertia.matrix)


def _walk(robot: RobotModel, q: Array) -> tuple[list[Body], dict[str, Array]]:
    """Return every body and every tool frame in ``world``, by the description alone."""
    base = _base(q)
    bodies, tools = [_body(robot.description.base.inertia, base)], {}
    angles = dict(zip(robot.joint_names, q[BASE_NQ:], strict=True))
    for arm in robot.description.arms:
        frame = base @ _placement(arm.mount)
        for joint, link in zip(arm.joints, arm.links, strict=True):
            turn = _rotation(np.array(joint.axis), angles[joint.name])
            frame = frame @ _placement(joint.origin) @ _homogeneous(turn, np.zeros(3))
            bodies.append(_body(link.inertia, frame))
        flange = frame @ _placement(arm.flange)
        bodies.append(_body(arm.gripper.inertia, flange))
        tools[arm.name] = flange @ _placement(arm.gripper.tool)
    return bodies, tools


def _along(robot: RobotModel, q: Array, v: Array, time: float) -> Array:
    """Return where q goes in ``time`` s under v, with the base moved by its body twist."""
    moved = np.array(q)
    base = robot.integrate_base(Pose(q[:3], q[3:BASE_NQ]), v[:BASE_NV], time)
    moved[:BASE_NQ] = pose_row(base)
    moved[BASE_NQ:] += time * v[BASE_NV:]
    return moved


def test_order_of_joints_and_degrees_of_freedom(robot: RobotModel) -> None:
    """Six of the base, then the joints of arm A from 1 to 7, then those of arm B."""
    names = [f"{arm}_joint_{number}" for arm in ("arm_a", "arm_b") for number in range(1, 8)]
    assert list(robot.joint_names) == names
    assert (robot.pin.nq, robot.pin.nv) == (21, 20)
    assert [robot.joint_index(name) for name in names] == list(range(14))
    assert robot.arm_joints == {"arm_a": slice(0, 7), "arm_b": slice(7, 14)}
    for arm, part in robot.arm_joints.items():
        assert all(name.startswith(arm) for name in robot.joint_names[part])


def test_mass_is_that_of_its_parts(robot: RobotModel) -> None:
    """240 kg and two arms of 7 kg."""
    assert robot.mass == pytest.approx(254.0, abs=1e-9)


def test_there_is_no_gravity(robot: RobotModel, draw: Draw) -> None:
    """A robot at rest without efforts stays at rest, to the rounding of forces of its weight on Earth."""
    acceleration = pin.aba(robot.pin, robot.data, draw.q(), np.zeros(20), np.zeros(20))
    assert np.max(np.abs(acceleration)) <= 254.0 * np.finfo(float).eps


def test_limits_are_those_of_the_description(robot: RobotModel) -> None:
    """Position and effort limits land at the joints they belong to."""
    joints = [joint for arm in robot.description.arms for joint in arm.joints]
    np.testing.assert_array_equal(robot.lower, [joint.lower for joint in joints])
    np.testing.assert_array_equal(robot.upper, [joint.upper for joint in joints])
    np.testing.assert_array_equal(robot.effort_limit, [joint.effort for joint in joints])


def test_tools_are_where_the_description_puts_them(robot: RobotModel, draw: Draw) -> None:
    """Forward kinematics from a moved base equals the product of the description's transformations."""
    for _ in range(20):
        q = draw.q()
        expected = _walk(robot, q)[1]
        poses = robot.tools_in_world(Pose(q[:3], q[3:BASE_NQ]), q[BASE_NQ:])
        assert set(poses) == set(expected) == set(robot.arms)
        for arm, pose in poses.items():
            rotation = _base(np.concatenate([np.zeros(3), pose.quaternion_xyzw]))[:3, :3]
            np.testing.assert_allclose(pose.position, expected[arm][:3, 3], atol=_ROUNDING)
            np.testing.assert_allclose(rotation, expected[arm][:3, :3], atol=_ROUNDING)


def test_momentum_and_energy_are_sums_over_the_bodies(robot: RobotModel, draw: Draw) -> None:
    """Each body gives m v, (r - c) x m v + I w and (m v^2 + w I w) / 2, its velocity taken by differences."""
    for _ in range(5):
        q, v = draw.q(), draw.v()
        conserved = conserved_quantities(robot, q, v)
        now, _ = _walk(robot, q)
        before, _ = _walk(robot, _along(robot, q, v, -FD_STEP))
        after, _ = _walk(robot, _along(robot, q, v, FD_STEP))
        mass = sum(body.mass for body in now)
        centre = sum(body.mass * body.centre for body in now) / mass
        linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
        for early, body, late in zip(before, now, after, strict=True):
            velocity = (late.centre - early.centre) / (2.0 * FD_STEP)
            rate = (late.rotation - early.rotation) / (2.0 * FD_STEP) @ body.rotation.T
            spin = np.array([rate[2, 1], rate[0, 2], rate[1, 0]])
            moments = body.rotation @ body.moments @ body.rotation.T
            linear += body.mass * velocity
            angular += np.cross(body.centre - centre, body.mass * velocity) + moments @ spin
            energy += 0.5 * body.mass * velocity @ velocity + 0.5 * spin @ moments @ spin
        # Velocities below 5 err by FD_BOUND; they enter with the mass, a lever below 2 m, and twice.
        bound = 10.0 * mass * FD_BOUND
        np.testing.assert_allclose(conserved.centre_of_mass, centre, atol=_ROUNDING)
        np.testing.assert_allclose(conserved.linear_momentum, linear, atol=bound)
        np.testing.assert_allclose(conserved.angular_momentum, angular, atol=bound)
        assert conserved.kinetic_energy == pytest.approx(energy, abs=bound)


def test_tool_twist_is_the_rate_of_its_pose(robot: RobotModel, draw: Draw) -> None:
    """The linear part moves the tool's origin, the angular part turns its axes, both in ``world`` axes."""
    for arm in robot.arms:
        q, v = draw.q(), draw.v()
        _, twist = robot.tool_motion(q, v, arm)
        before = _walk(robot, _along(robot, q, v, -FD_STEP))[1][arm]
        after = _walk(robot, _along(robot, q, v, FD_STEP))[1][arm]
        rate = (after - before) / (2.0 * FD_STEP)
        spin = rate[:3, :3] @ _walk(robot, q)[1][arm][:3, :3].T
        # With joint rates of 1 rad/s at eight axes in a row the third derivative reaches 8^3.
        bound = FD_STEP**2 / 6.0 * 8.0**3 + FD_BOUND
        np.testing.assert_allclose(twist.linear, rate[:3, 3], atol=bound)
        np.testing.assert_allclose(twist.angular, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=bound)


def test_base_follows_the_screw_of_its_twist(robot: RobotModel, draw: Draw) -> None:
    """A constant body twist moves the base by the matrix exponential of the twist, in its own axes."""
    pose, twist = draw.pose(), draw.vector(6)
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = _cross(twist[3:]), twist[:3]
    exponential, term = np.eye(4), np.eye(4)
    for power in range(1, 30):  # 2^30 / 30! is far below rounding
        term = term @ generator * (0.7 / power)
        exponential = exponential + term
    expected = _base(pose_row(pose)) @ exponential
    moved = robot.integrate_base(pose, twist, 0.7)
    np.testing.assert_allclose(_base(pose_row(moved)), expected, atol=_ROUNDING)


def test_state_and_vectors_are_one(robot: RobotModel, draw: Draw) -> None:
    """A state gives its parts back as they stand in q and v, bit for bit."""
    q, v = draw.q(), draw.v()
    state = state_of(robot, q, v)
    np.testing.assert_array_equal(state.q, q)
    np.testing.assert_array_equal(state.v, v)
    base, twist = state.base_in_world, state.twist_base_in_base
    np.testing.assert_array_equal(robot.configuration(base, state.joint_position), q)
    np.testing.assert_array_equal(np.concatenate([twist.linear, twist.angular, state.joint_velocity]), v)


def test_rotor_inertia_adds_to_its_own_joint_only(robot: RobotModel, draw: Draw) -> None:
    """A reflected rotor inertia stands on the diagonal of the mass matrix, at its joint."""
    arm = robot.description.arms[1]
    joints = list(arm.joints)
    joints[4] = replace(joints[4], rotor_inertia=0.22)
    arms = (robot.description.arms[0], replace(arm, joints=tuple(joints)))
    geared = RobotModel(replace(robot.description, arms=arms))
    q = draw.q()
    plain = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)
    with_rotor = pin.crba(geared.pin, geared.data, q, pin.Convention.WORLD)
    expected = np.zeros((20, 20))
    expected[BASE_NV + 7 + 4, BASE_NV + 7 + 4] = 0.22
    np.testing.assert_allclose(with_rotor - plain, expected, atol=254.0 * np.finfo(float).eps)


def test_unknown_names_are_answered_with_the_nearest(robot: RobotModel) -> None:
    """A joint or arm that the robot does not have is refused with a suggestion."""
    with pytest.raises(UnknownNameError, match=r"unknown joint 'arm_a_joint_9' \(did you mean 'arm_a_joint_"):
        robot.joint_index("arm_a_joint_9")
    with pytest.raises(UnknownNameError, match=r"here: unknown arm 'arm_c' \(did you mean 'arm_[ab]'\?\)"):
        robot.require_arm("arm_c", "here")
    robot.require_arm("arm_b")
