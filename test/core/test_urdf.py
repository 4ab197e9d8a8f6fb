"""The URDF carries the description unchanged: read back by Pinocchio it is the same robot."""

from dataclasses import replace
from math import cos, sin
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.frames import joint_name, mount_frame, tool_frame
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.description import load_robot
from sms_handover.model.parts import Inertia, Origin
from sms_handover.model.urdf import to_urdf
from sms_handover.types import Array

_BASE_NQ = 7
_ROUND_OFF = 1e-15  # [m], [kg m^2] a few units in the last place of numbers of order one


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """The robot as shipped."""
    return load_robot()


@pytest.fixture(scope="module")
def model(robot: RobotDescription) -> "pin.Model":
    """What Pinocchio makes of its URDF, on a free base."""
    return pin.buildModelFromXML(to_urdf(robot), pin.JointModelFreeFlyer())


@pytest.fixture(scope="module")
def tree(robot: RobotDescription) -> ET.Element:
    """The URDF as XML."""
    return ET.fromstring(to_urdf(robot))


# An independent forward kinematics, in plain NumPy, from the description alone.


def _homogeneous(rotation: Array, translation: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def _rotation(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by ``angle`` about a unit ``axis``, after Rodrigues."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + sin(angle) * cross + (1.0 - cos(angle)) * (cross @ cross))


def _placement(origin: Origin) -> Array:
    """Return the (4, 4) pose of an origin; rpy turns about the fixed x, then y, then z axis."""
    x, y, z = np.eye(3)
    roll, pitch, yaw = origin.rpy
    rotation = _rotation(z, yaw) @ _rotation(y, pitch) @ _rotation(x, roll)
    return _homogeneous(rotation, np.array(origin.xyz))


def _frames_in_base(robot: RobotDescription, joints: dict[str, float]) -> dict[str, Array]:
    """Return the (4, 4) pose of every link and frame in base_link."""
    frames = {"base_link": np.eye(4)}
    for arm in robot.arms:
        pose = frames[mount_frame(arm.name)] = _placement(arm.mount)
        for joint, link in zip(arm.joints, arm.links, strict=True):
            turn = _homogeneous(_rotation(np.array(joint.axis), joints[joint.name]), np.zeros(3))
            pose = frames[link.name] = pose @ _placement(joint.origin) @ turn
        pose = frames[arm.gripper.name] = pose @ _placement(arm.flange)
        frames[tool_frame(arm.name)] = pose @ _placement(arm.gripper.tool)
    return frames


def _bodies(robot: RobotDescription) -> list[Inertia]:
    """Return every body that has mass."""
    bodies = [robot.base.inertia]
    for arm in robot.arms:
        bodies += [link.inertia for link in arm.links] + [arm.gripper.inertia]
    return bodies


def _random_joints(robot: RobotDescription, seed: int) -> dict[str, float]:
    """Return an angle within the limits for every joint."""
    rng = np.random.default_rng(seed)
    joints = [joint for arm in robot.arms for joint in arm.joints]
    return {joint.name: float(rng.uniform(joint.lower, joint.upper)) for joint in joints}


def _configuration(model: "pin.Model", joints: dict[str, float]) -> Array:
    """Return Pinocchio's configuration, the base at the world's origin."""
    q: Array = pin.neutral(model)
    for name, angle in joints.items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    return q


# --- Pinocchio reads the same robot --------------------------------------------------------------


def test_degrees_of_freedom(model: "pin.Model") -> None:
    """A free flyer (7, 6) and 14 joints of one number each."""
    assert (model.nq, model.nv) == (21, 20)


def test_total_mass(model: "pin.Model") -> None:
    """240 kg and two arms of 7 kg."""
    assert pin.computeTotalMass(model) == pytest.approx(254.0, abs=1e-9)


def test_inertias_survive_unchanged(robot: RobotDescription, model: "pin.Model") -> None:
    """Each moving body has its mass, centre and moments; the last link has the gripper added to it."""
    expected = {"root_joint": _spatial(robot.base.inertia)}
    for arm in robot.arms:
        for joint, link in zip(arm.joints, arm.links, strict=True):
            expected[joint.name] = _spatial(link.inertia)
        flange = pin.SE3(_placement(arm.flange))
        expected[arm.joints[-1].name] += flange.act(_spatial(arm.gripper.inertia))
    assert set(expected) == set(model.names) - {"universe"}
    for name, inertia in expected.items():
        found = model.inertias[model.getJointId(name)]
        np.testing.assert_allclose(found.mass, inertia.mass, rtol=_ROUND_OFF, err_msg=name)
        np.testing.assert_allclose(found.lever, inertia.lever, atol=_ROUND_OFF, err_msg=name)
        np.testing.assert_allclose(found.inertia, inertia.inertia, atol=_ROUND_OFF, err_msg=name)


def _spatial(body: Inertia) -> "pin.Inertia":
    return pin.Inertia(body.mass, np.array(body.com), body.matrix)


def test_limits_survive_unchanged(robot: RobotDescription, model: "pin.Model") -> None:
    """Every limit is bit for bit that of the description, whatever order Pinocchio puts joints in."""
    for arm in robot.arms:
        for joint in arm.joints:
            index = model.joints[model.getJointId(joint.name)]
            assert model.lowerPositionLimit[index.idx_q] == joint.lower
            assert model.upperPositionLimit[index.idx_q] == joint.upper
            assert model.velocityLimit[index.idx_v] == joint.velocity
            assert model.effortLimit[index.idx_v] == joint.effort


@pytest.mark.parametrize("seed", range(5))
def test_every_frame_is_where_the_description_puts_it(
    robot: RobotDescription, model: "pin.Model", seed: int
) -> None:
    """Forward kinematics of the URDF agrees with one written from the description."""
    joints = _random_joints(robot, seed)
    expected = _frames_in_base(robot, joints)
    data = model.createData()
    pin.framesForwardKinematics(model, data, _configuration(model, joints))
    bodies = {f.name: i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    assert set(bodies) == set(expected)
    for name, index in bodies.items():
        np.testing.assert_allclose(data.oMf[index].homogeneous, expected[name], atol=1e-14, err_msg=name)


@pytest.mark.parametrize("seed", range(5))
def test_centre_of_mass(robot: RobotDescription, model: "pin.Model", seed: int) -> None:
    """The centre of mass is the mass-weighted mean over the bodies of the description."""
    joints = _random_joints(robot, seed)
    frames = _frames_in_base(robot, joints)
    bodies = _bodies(robot)
    centres = [(frames[body.body] @ np.array([*body.com, 1.0]))[:3] for body in bodies]
    expected = np.average(centres, axis=0, weights=[body.mass for body in bodies])
    found = pin.centerOfMass(model, model.createData(), _configuration(model, joints))
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_frame_names_are_unique(robot: RobotDescription, model: "pin.Model") -> None:
    """A frame can be looked up by its name alone."""
    names = [frame.name for frame in model.frames]
    assert len(names) == len(set(names))
    for arm in robot.arms:
        assert model.existFrame(tool_frame(arm.name))
        assert [joint.name for joint in arm.joints] == [joint_name(arm.name, i) for i in range(1, 8)]


def test_arms_may_come_in_any_order(robot: RobotDescription) -> None:
    """Names that sort against the order of the file still meet their own joints."""
    first, second = robot.arms
    text = to_urdf(replace(robot, arms=(second, first)))
    shipped = pin.buildModelFromXML(to_urdf(robot), pin.JointModelFreeFlyer())
    swapped = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    joints = _random_joints(robot, seed=0)
    for arm in robot.arms:
        poses = []
        for model in (shipped, swapped):
            data = model.createData()
            pin.framesForwardKinematics(model, data, _configuration(model, joints))
            poses.append(data.oMf[model.getFrameId(tool_frame(arm.name))].homogeneous)
        np.testing.assert_array_equal(poses[0], poses[1])


# --- the text itself -----------------------------------------------------------------------------


def test_numbers_keep_every_digit(robot: RobotDescription) -> None:
    """A mass that needs 17 digits comes back bit for bit, and a numpy number is written like any other."""
    arm = robot.arms[0]
    mass = float(np.nextafter(1.0 / 3.0, 1.0))
    link = replace(arm.links[0], inertia=replace(arm.links[0].inertia, mass=np.float64(mass)))
    changed = replace(arm, links=(link, *arm.links[1:]))
    model = pin.buildModelFromXML(to_urdf(replace(robot, arms=(changed,))), pin.JointModelFreeFlyer())
    assert model.inertias[model.getJointId(arm.joints[0].name)].mass == mass


def test_text_is_reproducible(robot: RobotDescription) -> None:
    """The same description always gives the same text, so a recording can be compared."""
    assert to_urdf(robot) == to_urdf(load_robot())
    assert to_urdf(robot).startswith('<?xml version="1.0"?>\n<robot name="sms_handover">')


def test_links_form_one_tree(tree: ET.Element) -> None:
    """Every link but base_link is the child of exactly one joint."""
    links = [link.attrib["name"] for link in tree.iter("link") if "name" in link.attrib]
    children = [_child(joint, "child").attrib["link"] for joint in tree.findall("joint")]
    parents = [_child(joint, "parent").attrib["link"] for joint in tree.findall("joint")]
    assert sorted(children) == sorted(set(links) - {"base_link"})
    assert set(parents) <= set(links)
    assert "base_link" not in children


def test_shapes_are_primitive_and_coloured(tree: ET.Element) -> None:
    """Boxes and cylinders only, each in a colour that the document defines."""
    assert {shape.tag for geometry in tree.iter("geometry") for shape in geometry} == {"box", "cylinder"}
    defined = {material.attrib["name"] for material in tree.findall("material")}
    used = {_child(visual, "material").attrib["name"] for visual in tree.iter("visual")}
    assert used == defined


def test_panels_are_drawn_but_neither_weigh_nor_collide(robot: RobotDescription, tree: ET.Element) -> None:
    """The spacecraft has a body and two panels to see, one body to collide with, and no mass from panels."""
    base = _child(tree, "link[@name='base_link']")
    assert len(robot.base.panels) == 2
    assert len(base.findall("visual")) == 3
    assert len(base.findall("collision")) == 1
    bare = replace(robot, base=replace(robot.base, panels=()))
    masses = [
        pin.computeTotalMass(pin.buildModelFromXML(to_urdf(it), pin.JointModelFreeFlyer()))
        for it in (robot, bare)
    ]
    assert masses[0] == masses[1]


def test_cylinders_reach_from_joint_to_joint(robot: RobotDescription, tree: ET.Element) -> None:
    """The two ends of what is drawn for a link are its own joint and the next one."""
    for arm in robot.arms:
        ends = [joint.origin.xyz for joint in arm.joints[1:]] + [arm.flange.xyz]
        for link, end in zip(arm.links, ends, strict=True):
            visual = _child(tree, f"link[@name='{link.name}']/visual")
            origin = _child(visual, "origin").attrib
            xyz, rpy = (tuple(float(value) for value in origin[key].split()) for key in ("xyz", "rpy"))
            length = float(_child(visual, "geometry/cylinder").attrib["length"])
            along = _placement(Origin(xyz, rpy))[:3, 2] * length / 2.0
            np.testing.assert_allclose(np.array(xyz) - along, np.zeros(3), atol=1e-15)
            np.testing.assert_allclose(np.array(xyz) + along, end, atol=1e-15)


def test_link_without_extent_is_not_drawn(robot: RobotDescription) -> None:
    """Joints that coincide leave nothing to draw, instead of a cylinder of length zero."""
    arm = robot.arms[0]
    second = replace(arm.joints[1], origin=Origin((0.0, 0.0, 0.0), arm.joints[1].origin.rpy))
    changed = replace(arm, joints=(arm.joints[0], second, *arm.joints[2:]))
    tree = ET.fromstring(to_urdf(replace(robot, arms=(changed,))))
    assert _child(tree, "link[@name='arm_a_link_1']").find("visual") is None


def test_pinocchio_reads_the_shapes(robot: RobotDescription, model: "pin.Model") -> None:
    """Body and panels, and per arm a pedestal, seven links and a gripper."""
    shapes = pin.buildGeomFromUrdfString(model, to_urdf(robot), pin.GeometryType.VISUAL)
    assert len(shapes.geometryObjects) == 3 + 2 * 9


def _child(element: ET.Element, path: str) -> ET.Element:
    """Return the first element at ``path``, which must exist."""
    found = element.find(path)
    assert found is not None, path
    return found
