"""Poses keep the quaternion order x y z w, and their distance is the angle that turns one into the other."""

from math import pi, sqrt

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.poses import pose_distance, pose_from_xyz_rpy, pose_of, pose_row, se3_of, twist_of
from sms_handover.types import Array, Pose

from .conftest import Draw, row_distance

# A rotation of a unit quaternion multiplies and adds a dozen numbers below 2.
_ROUNDING = 16 * 2.0 * np.finfo(float).eps


def _turn(axis: int, angle: float) -> Array:
    """Return the rotation matrix about a coordinate axis, from its definition."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix


@pytest.mark.parametrize("axis", range(3))
def test_quaternion_is_x_y_z_w(axis: int) -> None:
    """A quarter turn about an axis has sin 45 deg at that axis' place and cos 45 deg last."""
    expected = np.zeros(4)
    expected[axis], expected[3] = sqrt(0.5), sqrt(0.5)
    pose = pose_of(pin.SE3(_turn(axis, pi / 2), np.zeros(3)))
    np.testing.assert_allclose(pose.quaternion_xyzw, expected, atol=_ROUNDING)
    np.testing.assert_allclose(se3_of(pose).rotation, _turn(axis, pi / 2), atol=_ROUNDING)


def test_roll_pitch_yaw_turns_about_fixed_axes(draw: Draw) -> None:
    """As in URDF: first roll about x, then pitch about the old y, then yaw about the old z."""
    for _ in range(20):
        xyz, rpy = draw.vector(3), draw.vector(3, 3.0)
        pose = pose_from_xyz_rpy(xyz, rpy)
        expected = _turn(2, rpy[2]) @ _turn(1, rpy[1]) @ _turn(0, rpy[0])
        np.testing.assert_allclose(se3_of(pose).rotation, expected, atol=_ROUNDING)
        np.testing.assert_array_equal(pose.position, xyz)


def test_pose_and_transformation_are_one(draw: Draw) -> None:
    """Going to a matrix and back gives the same rotation, whichever sign the quaternion gets."""
    for _ in range(20):
        pose = draw.pose()
        again = pose_of(se3_of(pose))
        np.testing.assert_array_equal(again.position, pose.position)
        assert abs(abs(again.quaternion_xyzw @ pose.quaternion_xyzw) - 1.0) <= _ROUNDING


def test_going_to_a_matrix_and_back_does_not_add_up(draw: Draw) -> None:
    """A thousand conversions leave an orientation where it was: no error grows from one to the next."""
    for _ in range(20):
        pose = again = draw.pose()
        for _ in range(1000):
            again = pose_of(se3_of(again))
        assert row_distance(pose_row(pose), pose_row(again))[1] <= 1000 * _ROUNDING


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, pi - 1e-9, pi])
def test_distance_is_the_angle_of_the_turn(draw: Draw, angle: float) -> None:
    """The angle between two orientations is that of the turn between them, precise even when tiny."""
    pose = draw.pose()
    axis = draw.vector(3)
    turn = pin.exp3(angle * axis / np.linalg.norm(axis))
    other = pose_of(pin.SE3(se3_of(pose).rotation @ turn, pose.position + np.array([0.0, 3.0, 4.0])))
    metres, radians = pose_distance(pose, other)
    assert metres == pytest.approx(5.0, abs=_ROUNDING)
    assert radians == pytest.approx(angle, abs=_ROUNDING)
    assert (metres, radians) == pytest.approx(row_distance(pose_row(pose), pose_row(other)), abs=_ROUNDING)


def test_a_quaternion_and_its_negative_are_one_orientation(draw: Draw) -> None:
    """The quaternions q and -q turn alike, so there is no angle between them."""
    pose = draw.pose()
    assert pose_distance(pose, Pose(pose.position, -pose.quaternion_xyzw))[1] <= _ROUNDING


def test_row_is_position_then_quaternion() -> None:
    """The order of the pose columns of a run."""
    pose = Pose(np.array([1.0, 2.0, 3.0]), np.array([0.5, -0.5, 0.5, 0.5]))
    np.testing.assert_array_equal(pose_row(pose), [1.0, 2.0, 3.0, 0.5, -0.5, 0.5, 0.5])


def test_twist_is_linear_then_angular() -> None:
    """The order of a spatial velocity."""
    twist = twist_of(pin.Motion(np.arange(6.0)))
    np.testing.assert_array_equal(twist.linear, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(twist.angular, [3.0, 4.0, 5.0])


def test_a_pose_keeps_a_copy_that_cannot_change() -> None:
    """What was handed over cannot be changed from either side."""
    position = np.zeros(3)
    pose = Pose(position, np.array([0.0, 0.0, 0.0, 1.0]))
    position[0] = 1.0
    assert pose.position[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        pose.position[0] = 1.0
