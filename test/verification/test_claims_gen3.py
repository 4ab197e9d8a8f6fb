"""The arm against the published description of the Kinova Gen3.

Every number of the moving links is compared with the manufacturer's description, written down here a
second time from the source: a wrong sign in a light link hides in any test of the whole arm.
"""

import numpy as np
import pytest

from sms_handover.model.assembly import RobotDescription
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array
from test.evidence import Record
from test.verification.conftest import links_in_world

_SOURCE = "Kinovarobotics/ros2_kortex, gen3_macro.xacro"

# Mass kg, centre of mass m, ixx ixy ixz iyy iyz izz kg m^2 about it; shoulder to bracelet without vision.
_LINKS = (
    (1.3773, (-2.3e-5, -0.010364, -0.07336), (0.00457, 1e-6, 2e-6, 0.004831, 0.000448, 0.001409)),
    (1.1636, (-4.4e-5, -0.09958, -0.013278), (0.011088, 5e-6, 0.0, 0.001072, -0.000691, 0.011255)),
    (1.1636, (-4.4e-5, -0.006641, -0.117892), (0.010932, 0.0, -7e-6, 0.011127, 0.000606, 0.001043)),
    (0.9302, (-1.8e-5, -0.075478, -0.015006), (0.008147, -1e-6, 0.0, 0.000631, -0.0005, 0.008316)),
    (0.6781, (1e-6, -0.009432, -0.063883), (0.001596, 0.0, 0.0, 0.001607, 0.000256, 0.000399)),
    (0.6781, (1e-6, -0.045483, -0.00965), (0.001641, 0.0, 0.0, 0.00041, -0.000278, 0.001641)),
    (0.364, (-9.3e-5, 0.000132, -0.022905), (0.000214, 0.0, 1e-6, 0.000223, -2e-6, 0.00024)),
)

# Joint origins in the link before, m; the source rounds the angles, ours are exact multiples of pi/2.
_ORIGINS = (
    (0.0, 0.0, 0.15643),
    (0.0, 0.005375, -0.12838),
    (0.0, -0.21038, -0.006375),
    (0.0, 0.006375, -0.21038),
    (0.0, -0.20843, -0.006375),
    (0.0, 0.00017505, -0.10593),
    (0.0, -0.10593, -0.00017505),
)

# Where the flange is in the mount, m, as published packages of the same arm give it to six digits.
_FLANGE = (
    ((0.0,) * 7, (0.0, -0.02486, 1.187385)),
    (
        (0.0, 0.26179939, 3.14159265, -2.26892803, 0.0, 0.95993109, 1.57079633),
        (0.456665, 0.001347, 0.433724),
    ),
)


@pytest.fixture(scope="module")
def description() -> RobotDescription:
    """The robot as shipped."""
    return load_robot()


def _farthest(found: Array, published: Array) -> float:
    return float(np.max(np.abs(np.asarray(found) - np.asarray(published))))


def test_every_number_of_the_links(description: RobotDescription, record: Record) -> None:
    """Masses, centres and moments of both arms are those of the source, digit by digit."""
    masses, centres, moments = zip(*_LINKS, strict=True)
    for arm in description.arms:
        links = [link.inertia for link in arm.links]
        off = _farthest(np.array([link.mass for link in links]), np.array(masses))
        record(f"{arm.name}: masses of the links", off, 0.0, unit="kg", against=_SOURCE)
        off = _farthest(np.array([link.com for link in links]), np.array(centres))
        record(f"{arm.name}: centres of mass of the links", off, 0.0, unit="m", against=_SOURCE)
        off = _farthest(np.array([link.moments for link in links]), np.array(moments))
        record(f"{arm.name}: moments of inertia of the links", off, 0.0, unit="kg m^2", against=_SOURCE)
        off = _farthest(np.array([joint.origin.xyz for joint in arm.joints]), np.array(_ORIGINS))
        record(f"{arm.name}: origins of the joints", off, 0.0, unit="m", against=_SOURCE)


def _tilt(description: RobotDescription) -> float:
    """Return how far the flange moves, in m, because the source rounds pi and pi/2 to four decimals."""
    arm = description.arms[0]
    lengths = [float(np.linalg.norm(joint.origin.xyz)) for joint in arm.joints[1:]]
    lengths.append(float(np.linalg.norm(arm.flange.xyz)))
    beyond = np.cumsum(lengths[::-1])[::-1]  # from each joint to the flange at most
    turns = np.array([3.1416 - np.pi] + 6 * [1.5708 - np.pi / 2.0])
    return float(np.abs(turns) @ beyond)


def test_where_the_flange_is(description: RobotDescription, record: Record) -> None:
    """Forward kinematics meets the published poses but for the rounded angles of the source."""
    robot = RobotModel(description)
    bound = _tilt(description) + 5e-7  # six digits
    origin = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    for joints, published in _FLANGE:
        for arm in description.arms:
            placed = np.zeros(robot.n_joints)
            placed[robot.arm_joints[arm.name]] = joints
            links = links_in_world(robot, np.concatenate([origin, placed]))
            mount, flange = links[f"{arm.name}_mount"], links[arm.gripper.name]
            x, y, z = flange.position - mount.position
            # The arm's z is the body's x and its x the body's -z: what the mount turns by pi/2 about y.
            off = _farthest(np.array([-z, y, x]), np.array(published))
            at = "zero joints" if not any(joints) else "the pose 'home'"
            against = "published forward kinematics, six digits"
            record(f"{arm.name}: flange in its mount at {at}", off, bound, unit="m", against=against)
