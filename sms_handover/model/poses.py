"""Poses converted to and from Pinocchio's SE3 and roll-pitch-yaw."""

import numpy as np
import pinocchio as pin

from sms_handover.configuration.sections import Section
from sms_handover.types import Array, Pose, Twist, frozen


def se3_of(pose: Pose) -> pin.SE3:
    """Return the homogeneous transformation of a pose.

    The quaternion is normalised first: an error of its length in the last digit would grow by about
    half each time a pose goes from quaternion to matrix and back.
    """
    return pin.SE3(pin.Quaternion(pose.quaternion_xyzw).normalized(), pose.position)


def pose_of(transformation: pin.SE3) -> Pose:
    """Return position and quaternion (x y z w) of a homogeneous transformation."""
    row = frozen(pin.SE3ToXYZQUAT(transformation))
    return Pose(row[:3], row[3:])


def pose_from_xyz_rpy(xyz: Array, rpy: Array) -> Pose:
    """Return a pose from a position in m and fixed-axis roll, pitch, yaw in rad (as in URDF)."""
    rotation = pin.rpy.rpyToMatrix(np.asarray(rpy, dtype=np.float64))
    return pose_of(pin.SE3(rotation, np.asarray(xyz, dtype=np.float64)))


def read_pose(section: Section) -> Pose:
    """Return the pose that a section gives by ``xyz`` and ``rpy``."""
    return pose_from_xyz_rpy(np.array(section.vector("xyz")), np.array(section.vector("rpy")))


def pose_row(pose: Pose) -> Array:
    """Return a pose as one row (7,): position, then quaternion x y z w."""
    return np.concatenate([pose.position, pose.quaternion_xyzw])


def twist_of(motion: pin.Motion) -> Twist:
    """Return the linear and angular parts of a spatial velocity."""
    row = frozen(np.array(motion.vector))
    return Twist(row[:3], row[3:])


def twist_in_deputy(pose_in_world: Array, twist_in_world: Array) -> Array:
    """Return twists (..., 6) of poses (..., 7) in ``world`` axes in the axes of the poses.

    Each half x is turned by the inverse of the quaternion (u, w), x - 2 w (u x x) + 2 u x (u x x), by sums of
    a fixed order, so that one row gives the same bits as many.
    """
    inverse, w = -pose_in_world[..., 3:6], pose_in_world[..., 6:7]
    halves = []
    for half in (twist_in_world[..., :3], twist_in_world[..., 3:]):
        across = 2.0 * _across(inverse, half)
        halves.append(half + w * across + _across(inverse, across))
    return np.concatenate(halves, axis=-1)


def _across(a: Array, b: Array) -> Array:
    """Return a x b of rows (..., 3)."""
    ax, ay, az = (a[..., i] for i in range(3))
    bx, by, bz = (b[..., i] for i in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def pose_distance(a: Pose, b: Pose) -> tuple[float, float]:
    """Return the distance in m between two origins and the angle in rad between two orientations.

    The angle is taken from the vector part too, so it keeps its precision near zero:
    2 atan2(|v|, |w|) of the relative quaternion.
    """
    relative = pin.Quaternion(a.quaternion_xyzw).conjugate() * pin.Quaternion(b.quaternion_xyzw)
    x, y, z, w = relative.coeffs()
    angle = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), abs(w))
    return float(np.linalg.norm(a.position - b.position)), float(angle)
