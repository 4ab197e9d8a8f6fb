"""URDF text of a robot description, for Pinocchio and for viewers.

Numbers keep full double precision. URDF has no rotor inertia.
"""

from collections.abc import Sequence
from math import atan2, hypot, pi
from xml.etree import ElementTree as ET

from sms_handover.frames import BASE, mount_frame, tool_frame
from sms_handover.model.assembly import ArmDescription, RobotDescription
from sms_handover.model.panels import FlexiblePanel
from sms_handover.model.parts import Inertia, JointDescription, LinkDescription, Origin
from sms_handover.model.shape_elements import replace_solids, write_contacts
from sms_handover.model.shapes import AT_ORIGIN
from sms_handover.model.urdf_values import STIFFNESS, add_origin, numbers

_SWIFT = 1e9  # [rad/s] limit of the rate of a hinge, where URDF asks for one
_COLOURS = {  # [-] red, green, blue, opacity; appearance only
    "body": (0.75, 0.68, 0.45, 1.0),
    "panel": (0.10, 0.16, 0.42, 1.0),
    "link": (0.80, 0.82, 0.85, 1.0),
    "gripper": (0.25, 0.27, 0.30, 1.0),
}


def to_urdf(robot: RobotDescription, *, panels_move: bool = True) -> str:
    """Return the robot as URDF with ``base_link`` as its root.

    Per arm: link ``<arm>_mount`` fixed to the body, joints ``<arm>_joint_<i>`` moving links
    ``<arm>_link_<i>``, then ``<arm>_gripper`` with its frame on the flange and ``<arm>_tool``, fixed.
    Shapes are boxes and cylinders; the solar panels are visual only. A panel on a hinge is a link
    ``panel_<i>``; its joint is fixed unless ``panels_move``, and has the stiffness of its spring as an
    attribute of ``dynamics`` that others ignore. What the description says of clearance
    replaces the collision elements of links, and is in an element of its own that others ignore.
    """
    root = ET.Element("robot", name=robot.name)
    for name, rgba in _COLOURS.items():
        ET.SubElement(ET.SubElement(root, "material", name=name), "color", rgba=numbers(rgba))
    base = _link(root, BASE, robot.base.inertia)
    _box(base, robot.base.size, AT_ORIGIN, "body", solid=True)
    for panel in robot.base.panels:
        if panel.hinge is None:
            _box(base, panel.size, Origin(panel.xyz, (0.0, 0.0, 0.0)), "panel", solid=False)
    for flexible in robot.flexible_panels:
        _panel(root, flexible, moves=panels_move)
    for arm in robot.arms:
        _arm(root, arm)
    replace_solids(root, robot.shapes)
    write_contacts(root, robot.shapes, robot.contacts)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _arm(root: ET.Element, arm: ArmDescription) -> None:
    """Add the links and joints of one arm, from its mount to its tool frame."""
    parent = mount_frame(arm.name)
    pedestal = _link(root, parent)
    _cylinder_to(pedestal, arm.joints[0].origin.xyz, arm.links[0].radius, "link")
    _fixed(root, BASE, parent, arm.mount)
    ends = [joint.origin.xyz for joint in arm.joints[1:]] + [arm.flange.xyz]
    for joint, link, end in zip(arm.joints, arm.links, ends, strict=True):
        _moving(root, parent, joint, link)
        _cylinder_to(_link(root, link.name, link.inertia), end, link.radius, "link")
        parent = link.name
    gripper = arm.gripper
    body = _link(root, gripper.name, gripper.inertia)
    _cylinder_to(body, gripper.tool.xyz, gripper.radius, "gripper")
    _fixed(root, parent, gripper.name, arm.flange)
    _link(root, tool_frame(arm.name))
    _fixed(root, gripper.name, tool_frame(arm.name), gripper.tool)


def _panel(root: ET.Element, panel: FlexiblePanel, *, moves: bool) -> None:
    """Add a panel and its hinge."""
    link = _link(root, panel.link, panel.inertia)
    _box(link, panel.panel.size, Origin(panel.centre, (0.0, 0.0, 0.0)), "panel", solid=False)
    hinge, place = panel.hinge, Origin(panel.hinge.xyz, (0.0, 0.0, 0.0))
    if not moves:
        _connect(ET.SubElement(root, "joint", name=panel.joint, type="fixed"), BASE, panel.link, place)
        return
    joint = ET.SubElement(root, "joint", name=panel.joint, type="revolute")
    _connect(joint, BASE, panel.link, place)
    ET.SubElement(joint, "axis", xyz=numbers(hinge.axis))
    bounds = {"lower": numbers([-pi]), "upper": numbers([pi]), "velocity": numbers([_SWIFT])}
    ET.SubElement(joint, "limit", {**bounds, "effort": numbers([0.0])})
    damper = {"damping": numbers([hinge.damping]), "friction": numbers([0.0])}
    ET.SubElement(joint, "dynamics", {**damper, STIFFNESS: numbers([hinge.stiffness])})


def _link(root: ET.Element, name: str, inertia: Inertia | None = None) -> ET.Element:
    """Add a link; without an inertia it is a massless frame."""
    link = ET.SubElement(root, "link", name=name)
    if inertia is not None:
        element = ET.SubElement(link, "inertial")
        add_origin(element, Origin(inertia.com, (0.0, 0.0, 0.0)))
        ET.SubElement(element, "mass", value=numbers([inertia.mass]))
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        moments = {key: numbers([moment]) for key, moment in zip(keys, inertia.moments, strict=True)}
        ET.SubElement(element, "inertia", moments)
    return link


def _fixed(root: ET.Element, parent: str, child: str, origin: Origin) -> None:
    """Fix one link to another."""
    _connect(ET.SubElement(root, "joint", name=f"{child}_fixed", type="fixed"), parent, child, origin)


def _moving(root: ET.Element, parent: str, joint: JointDescription, link: LinkDescription) -> None:
    """Add the joint that moves a link."""
    element = ET.SubElement(root, "joint", name=joint.name, type="revolute")
    _connect(element, parent, link.name, joint.origin)
    ET.SubElement(element, "axis", xyz=numbers(joint.axis))
    limits = {
        "lower": numbers([joint.lower]),
        "upper": numbers([joint.upper]),
        "velocity": numbers([joint.velocity]),
        "effort": numbers([joint.effort]),
    }
    ET.SubElement(element, "limit", limits)


def _connect(joint: ET.Element, parent: str, child: str, origin: Origin) -> None:
    """Add parent and child of a joint, and its frame in the parent."""
    add_origin(joint, origin)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)


def _box(link: ET.Element, size: Sequence[float], origin: Origin, colour: str, *, solid: bool) -> None:
    """Add a box to the visuals and, if solid, to the collision shapes."""
    for element in _shapes(link, origin, colour, solid=solid):
        ET.SubElement(element, "box", size=numbers(size))


def _cylinder_to(link: ET.Element, end: Sequence[float], radius: float, colour: str) -> None:
    """Add a solid cylinder from the origin of a link's frame to ``end`` (3,) m, if they differ."""
    x, y, z = end
    across = hypot(x, y)
    length = hypot(across, z)
    if length == 0.0:
        return
    middle = Origin((x / 2.0, y / 2.0, z / 2.0), (0.0, atan2(across, z), atan2(y, x)))
    for element in _shapes(link, middle, colour, solid=True):
        ET.SubElement(element, "cylinder", radius=numbers([radius]), length=numbers([length]))


def _shapes(link: ET.Element, origin: Origin, colour: str, *, solid: bool) -> list[ET.Element]:
    """Add a visual and, if solid, a collision element; return the geometry elements to fill."""
    geometries = []
    for kind in ("visual", "collision") if solid else ("visual",):
        element = ET.SubElement(link, kind)
        add_origin(element, origin)
        geometries.append(ET.SubElement(element, "geometry"))
        if kind == "visual":
            ET.SubElement(element, "material", name=colour)
    return geometries
