"""The path from pose to pose: a straight line, the shortest turn, and the twist that belongs to it."""

from math import pi

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.trajectory.pose_path import PosePath
from sms_handover.trajectory.time_law import Progress
from sms_handover.types import Pose, Twist

from .conftest import FD_BOUND, FD_STEP, Draw

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS


def _between(draw: Draw, angle: float) -> PosePath:
    """Return a path that turns by an angle."""
    start = draw.pose()
    axis = draw.vector(3)
    turn = pin.exp3(angle * axis / np.linalg.norm(axis))
    return PosePath(start, pose_of(pin.SE3(se3_of(start).rotation @ turn, draw.vector(3))))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, 3.0])
def test_path_begins_and_ends_at_its_poses(draw: Draw, angle: float) -> None:
    """At fraction 0 it is the start, at 1 the end, bit for bit when the motion is over."""
    path = _between(draw, angle)
    assert max(pose_distance(path.at(Progress(0.0, 0.0))[0], path.start)) <= _ROUNDING
    # the logarithm of a turn near pi is known to eps / (pi - angle)
    assert max(pose_distance(path.at(Progress(1.0, 0.5))[0], path.end)) <= _ROUNDING / (pi - angle) * pi
    pose, twist = path.at(Progress(1.0, 0.0))
    assert pose is path.end
    assert not np.any(twist.linear) and not np.any(twist.angular)


@pytest.mark.parametrize("angle", [0.3, 2.0, 3.0])
def test_path_is_straight_and_turns_evenly(draw: Draw, angle: float) -> None:
    """At every fraction that share of the way and of the angle is done: it is the shortest on both counts."""
    path = _between(draw, angle)
    metres, radians = pose_distance(path.start, path.end)
    assert radians == pytest.approx(angle, abs=_ROUNDING)
    for fraction in np.linspace(0.0, 1.0, 11):
        pose, _ = path.at(Progress(float(fraction), 1.0))
        done, left = pose_distance(path.start, pose), pose_distance(pose, path.end)
        assert done == pytest.approx((fraction * metres, fraction * radians), abs=10 * _ROUNDING)
        assert left == pytest.approx(((1 - fraction) * metres, (1 - fraction) * radians), abs=10 * _ROUNDING)


def test_twist_is_the_rate_of_the_pose(draw: Draw) -> None:
    """Of the origin and of the axes, both in ``world``, by differences of the poses along the path."""
    path, rate = _between(draw, 2.0), 0.7
    for fraction in (0.0, 0.25, 0.9):
        behind, ahead = (path.at(Progress(fraction + side * rate * FD_STEP, rate))[0] for side in (-1.0, 1.0))
        _, twist = path.at(Progress(fraction, rate))
        linear = (ahead.position - behind.position) / (2.0 * FD_STEP)
        angular = pin.log3(se3_of(ahead).rotation @ se3_of(behind).rotation.T) / (2.0 * FD_STEP)
        np.testing.assert_allclose(twist.linear, linear, atol=FD_BOUND)
        np.testing.assert_allclose(twist.angular, angular, atol=FD_BOUND)


def test_twist_includes_that_of_a_goal_that_moves(draw: Draw) -> None:
    """By differences of poses of the path while its goal goes on; at the end it is the twist of the goal."""
    still, rate = _between(draw, 2.0), 0.7
    end, twist = se3_of(still.end), Twist(draw.vector(3), draw.vector(3))

    def at(fraction: float, time: float) -> tuple[Pose, Twist]:
        moved = pin.SE3(pin.exp3(time * twist.angular) @ end.rotation, end.translation + time * twist.linear)
        return PosePath(still.start, pose_of(moved), twist).at(Progress(fraction + rate * time, rate))

    for fraction in (0.0, 0.25, 0.9):
        (behind, _), (ahead, _) = at(fraction, -FD_STEP), at(fraction, FD_STEP)
        _, found = at(fraction, 0.0)
        linear = (ahead.position - behind.position) / (2.0 * FD_STEP)
        angular = pin.log3(se3_of(ahead).rotation @ se3_of(behind).rotation.T) / (2.0 * FD_STEP)
        np.testing.assert_allclose(found.linear, linear, atol=FD_BOUND)
        np.testing.assert_allclose(found.angular, angular, atol=FD_BOUND)
    assert PosePath(still.start, still.end, twist).at(Progress(1.0, 0.0)) == (still.end, twist)


def test_the_shorter_way_round_is_taken(draw: Draw) -> None:
    """Whatever sign the quaternions have, the turn is below half a turn."""
    start = draw.pose()
    end = Pose(start.position, -start.quaternion_xyzw)
    for fraction in (0.25, 0.5, 0.75):
        assert pose_distance(PosePath(start, end).at(Progress(fraction, 1.0))[0], start)[1] <= _ROUNDING
