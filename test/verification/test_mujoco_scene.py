"""Pictures: the robot as MuJoCo reads it from the same URDF text.

MuJoCo parses the description by itself. At random states every link and every drawn shape lies where
the scene has it, so what is shown is what was simulated.
"""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from sms_handover.frames import BASE
from sms_handover.model.description import load_robot
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.scene.links import DescribedRobot
from sms_handover.scene.shapes import read_shapes
from sms_handover.types import Array, Pose
from test.evidence import Record

_STATES = 100
_EPS = float(np.finfo(float).eps)
_ROUNDING = 10 * 12 * _EPS  # [-] ten frames in a chain, a dozen operations each
_VISUAL = 1  # [-] the geometry group of a URDF's <visual> elements in MuJoCo
_AGAINST = f"MuJoCo {mujoco.__version__}, URDF"


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel(load_robot())


@pytest.fixture(scope="module")
def reader(robot: RobotModel) -> mujoco.MjModel:
    """MuJoCo's own reading of the URDF; it fixes the base to its world."""
    root = ET.fromstring(robot.urdf)
    kept = {"fusestatic": "false", "discardvisual": "false", "balanceinertia": "false"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", kept)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def posed(poses: Array, links: tuple[str, ...]) -> dict[str, pin.SE3]:
    """Return where links are relative to ``base_link``."""
    placed = {name: se3_of(Pose(row[:3], row[3:])) for name, row in zip(links, poses, strict=True)}
    return {name: placed[BASE].actInv(pose) for name, pose in placed.items()}


def test_links_and_shapes_are_where_mujoco_has_them(
    robot: RobotModel, reader: mujoco.MjModel, record: Record
) -> None:
    random = np.random.default_rng(7)
    described = DescribedRobot(robot.urdf)
    shapes = read_shapes(described.pin, robot.urdf)
    drawn = [geom for geom in range(reader.ngeom) if reader.geom_group[geom] == _VISUAL]
    assert len(drawn) == len(shapes)
    data = mujoco.MjData(reader)
    places = [int(reader.joint(name).qposadr[0]) for name in robot.joint_names]
    link_error, shape_error = 0.0, 0.0
    for _ in range(_STATES):
        joints = random.uniform(-np.pi, np.pi, robot.n_joints)
        data.qpos[places] = joints
        mujoco.mj_kinematics(reader, data)
        base = np.array([0.3, -0.2, 0.7, 0.1, -0.5, 0.7, 0.5])
        links = posed(described.poses(base[None], joints[None], robot.joint_names)[0], described.links)
        for name, in_base in links.items():
            body = reader.body(name).id
            link_error = max(link_error, np.abs(in_base.translation - data.xpos[body]).max())
            link_error = max(link_error, np.abs(in_base.rotation - data.xmat[body].reshape(3, 3)).max())
        for geom, shape in zip(drawn, shapes, strict=True):
            in_base = links[shape.link] * se3_of(shape.pose_in_link)
            shape_error = max(shape_error, np.abs(in_base.translation - data.geom_xpos[geom]).max())
            axes = data.geom_xmat[geom].reshape(3, 3)
            shape_error = max(shape_error, np.abs(in_base.rotation - axes).max())
    record("links: position and rotation", link_error, _ROUNDING, unit="m, -", against=_AGAINST)
    record("shapes: position and rotation", shape_error, _ROUNDING, unit="m, -", against=_AGAINST)


def test_shapes_have_the_size_and_colour_that_mujoco_reads(
    robot: RobotModel, reader: mujoco.MjModel, record: Record
) -> None:
    shapes = read_shapes(DescribedRobot(robot.urdf).pin, robot.urdf)
    drawn = [geom for geom in range(reader.ngeom) if reader.geom_group[geom] == _VISUAL]
    size_error, colour_error = 0.0, 0.0
    for geom, shape in zip(drawn, shapes, strict=True):
        half = reader.geom_size[geom]
        size = 2.0 * half if shape.kind == "box" else (half[0], 2.0 * half[1])
        size_error = max(size_error, float(np.abs(np.subtract(shape.size, size)).max()))
        colour_error = max(colour_error, float(np.abs(shape.rgba - reader.geom_rgba[geom]).max()))
        kinds = {mujoco.mjtGeom.mjGEOM_BOX: "box", mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder"}
        assert kinds[mujoco.mjtGeom(int(reader.geom_type[geom]))] == shape.kind
    record("shapes: size", size_error, _ROUNDING, unit="m", against=_AGAINST)
    single = float(np.finfo(np.float32).eps)
    record("shapes: colour", colour_error, single, against=_AGAINST)  # both keep single precision
