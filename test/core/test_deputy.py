"""The deputy moves as a rigid body that is held by one tool, or by nobody."""

from math import nextafter

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.plant.deputy import GraspErrors, GraspTolerance, MasslessDeputy
from sms_handover.types import Array, Pose, Twist

from .conftest import FD_BOUND, FD_STEP, Draw

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS  # three products of transformations of numbers below 3
_AT_REST = Twist(np.zeros(3), np.zeros(3))
_FRAMES = {"near": Pose(np.array([0.0, 0.12, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))}


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    """Return where a pose goes whose origin keeps its velocity and whose axes keep their spin."""
    rotation = pin.exp3(twist.angular * time) @ se3_of(pose).rotation
    return pose_of(pin.SE3(rotation, pose.position + time * twist.linear))


def _rate(before: Pose, after: Pose, time: float) -> Array:
    """Return the twist (6,) between two poses by differences."""
    turn = pin.log3(se3_of(after).rotation @ se3_of(before).rotation.T)
    return np.concatenate([after.position - before.position, turn]) / time


def test_a_new_deputy_floats_at_rest(draw: Draw) -> None:
    """Nobody holds it and it does not move."""
    pose = draw.pose()
    deputy = MasslessDeputy(pose, _FRAMES)
    deputy.drift(5.0)
    state = deputy.state
    assert (deputy.holder, state.holder) == ("", "")
    assert max(pose_distance(state.deputy_in_world, pose)) <= _ROUNDING
    np.testing.assert_array_equal(state.twist_deputy_in_world.linear, np.zeros(3))
    np.testing.assert_array_equal(state.twist_deputy_in_world.angular, np.zeros(3))


def test_grasping_moves_nothing(draw: Draw) -> None:
    """Whatever the error of the grasp, the deputy stays where it is at that instant."""
    pose = draw.pose()
    deputy = MasslessDeputy(pose, _FRAMES)
    tool = draw.pose()
    deputy.attach("arm_a", tool)
    deputy.follow(tool, _AT_REST)
    assert max(pose_distance(deputy.state.deputy_in_world, pose)) <= _ROUNDING
    assert deputy.holder == "arm_a"


def test_a_held_deputy_is_rigid_in_the_tool(draw: Draw) -> None:
    """Its pose in the tool is the one at the grasp, wherever the tool goes."""
    pose, tool = draw.pose(), draw.pose()
    deputy = MasslessDeputy(pose, _FRAMES)
    deputy.attach("arm_a", tool)
    at_grasp = pose_of(se3_of(tool).inverse() * se3_of(pose))
    for _ in range(10):
        later = draw.pose()
        deputy.follow(later, _AT_REST)
        now = pose_of(se3_of(later).inverse() * se3_of(deputy.state.deputy_in_world))
        assert max(pose_distance(now, at_grasp)) <= _ROUNDING


def test_twist_of_a_held_deputy_is_the_rate_of_its_pose(draw: Draw) -> None:
    """The velocity of its origin has the lever arm to the tool in it; its spin is the tool's."""
    pose, tool = draw.pose(), draw.pose()
    twist = Twist(draw.vector(3), draw.vector(3))
    deputy = MasslessDeputy(pose, _FRAMES)
    deputy.attach("arm_a", tool)
    ends = []
    for time in (-FD_STEP, FD_STEP):
        deputy.follow(_moved(tool, twist, time), twist)
        ends.append(deputy.state.deputy_in_world)
    deputy.follow(tool, twist)
    found = deputy.state.twist_deputy_in_world
    expected = _rate(ends[0], ends[1], 2.0 * FD_STEP)
    np.testing.assert_allclose(np.concatenate([found.linear, found.angular]), expected, atol=FD_BOUND)


def test_a_free_deputy_keeps_its_twist(draw: Draw) -> None:
    """Let go in motion, its origin flies straight and its axes turn evenly; many short ways make one long."""
    pose, tool = draw.pose(), draw.pose()
    twist = Twist(draw.vector(3), draw.vector(3))
    deputy = MasslessDeputy(pose, _FRAMES)
    deputy.attach("arm_b", tool)
    deputy.follow(tool, twist)
    deputy.detach()
    own = deputy.state.twist_deputy_in_world
    for _ in range(100):
        deputy.drift(0.01)
    assert deputy.holder == ""
    assert max(pose_distance(deputy.state.deputy_in_world, _moved(pose, own, 1.0))) <= 100 * _ROUNDING


def test_errors_are_those_of_tool_and_grasp_frame(draw: Draw) -> None:
    """Distance, angle and relative speed of the two origins, for a deputy that flies and spins."""
    pose, tool = draw.pose(), draw.pose()
    twist = Twist(draw.vector(3), draw.vector(3))
    deputy = MasslessDeputy(pose, _FRAMES)
    deputy.attach("arm_a", tool)
    deputy.follow(tool, twist)
    deputy.detach()

    def frame_at(time: float) -> Pose:
        """Return the grasp frame as the deputy flies on."""
        moved = _moved(pose, deputy.state.twist_deputy_in_world, time)
        return pose_of(se3_of(moved) * se3_of(_FRAMES["near"]))

    velocity = _rate(frame_at(-FD_STEP), frame_at(FD_STEP), 2.0 * FD_STEP)[:3]
    own = Twist(draw.vector(3), draw.vector(3))
    off = 0.3 * np.array([2.0, -1.0, 2.0]) / 3.0  # rad, about an axis of the frame
    other = pose_of(se3_of(frame_at(0.0)) * pin.SE3(pin.exp3(off), np.array([0.0, 0.03, -0.04])))
    errors = deputy.errors_of("near", other, own)
    assert errors.position == pytest.approx(0.05, abs=_ROUNDING)
    assert errors.angle == pytest.approx(0.3, abs=_ROUNDING)
    assert errors.speed == pytest.approx(np.linalg.norm(own.linear - velocity), abs=2 * FD_BOUND)


@pytest.mark.parametrize(
    ("errors", "holds"),
    [
        (GraspErrors(0.0, 0.0, 0.0, 0.0), True),
        (GraspErrors(0.01, 0.03, 0.02, 0.04), True),
        (GraspErrors(nextafter(0.01, 1.0), 0.0, 0.0, 0.0), False),
        (GraspErrors(0.0, nextafter(0.03, 1.0), 0.0, 0.0), False),
        (GraspErrors(0.0, 0.0, nextafter(0.02, 1.0), 0.0), False),
        (GraspErrors(0.0, 0.0, 0.0, nextafter(0.04, 1.0)), False),
        (GraspErrors(float("nan"), 0.0, 0.0, 0.0), False),
    ],
)
def test_each_tolerance_counts_by_itself(errors: GraspErrors, holds: bool) -> None:
    """A grasp holds with every error at its tolerance, and with none beyond it."""
    assert errors.within(GraspTolerance(0.01, 0.03, 0.02, 0.04)) is holds
