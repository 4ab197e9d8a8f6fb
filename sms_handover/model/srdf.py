"""SRDF text of a robot: its groups, end effectors, and the pairs of links that need not be checked."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from xml.etree import ElementTree as ET

from sms_handover.errors import RobotDescriptionError
from sms_handover.frames import WORLD, tool_frame
from sms_handover.model.urdf_tree import FIXED, UrdfTree, read_urdf


class DisabledReason(Enum):
    """Why a pair of links is not checked for collisions; the value is what SRDF calls it."""

    ADJACENT = "Adjacent"
    ALWAYS = "Always"
    NEVER = "Never"  # fixed to each other without being neighbours
    USER = "User"  # stated in the description


@dataclass(frozen=True)
class DisabledPair:
    """Two links between which collisions are not checked."""

    first: str
    second: str
    reason: DisabledReason


def to_srdf(urdf: str, disabled: Iterable[DisabledPair]) -> str:
    """Return the SRDF of a free-floating robot that URDF text describes.

    Per arm there is a group of its chain, from the link that carries its first joint to the link that its
    last joint moves, and a group of what is fixed to that, its gripper and tool frame, as an end effector.
    Two arms have a group ``both``, more have ``all``. Raises RobotDescriptionError if the text is no URDF,
    or describes no arm: a chain of joints to a link whose name ends in ``_tool``.
    """
    tree = read_urdf(urdf)
    arms = tree.arms
    if not arms:
        raise RobotDescriptionError(f"no link's name ends in {tool_frame('')!r}, so the robot has no arm")
    root = ET.Element("robot", name=tree.name)
    ends = {arm: _group(root, tree, arm) for arm in arms}
    if len(arms) > 1:
        every = ET.SubElement(root, "group", name="both" if len(arms) == len(("a", "b")) else "all")
        for arm in arms:
            ET.SubElement(every, "group", name=arm)
    for arm, last in ends.items():
        name = _end_effector(arm)
        ET.SubElement(root, "end_effector", name=name, parent_link=last, group=name, parent_group=arm)
    ET.SubElement(
        root, "virtual_joint", name="floating", type="floating", parent_frame=WORLD, child_link=tree.root
    )
    for joint in tree.joints:
        if joint.is_passive:
            ET.SubElement(root, "passive_joint", name=joint.name)
    for pair in disabled:
        reason = pair.reason.value
        ET.SubElement(root, "disable_collisions", link1=pair.first, link2=pair.second, reason=reason)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _group(root: ET.Element, tree: UrdfTree, arm: str) -> str:
    """Add the groups of an arm and of its gripper; return the link that the last joint moves."""
    joints = list(tree.chain(tool_frame(arm)))
    moving = [place for place, joint in enumerate(joints) if joint.kind != FIXED]
    if not moving:
        raise RobotDescriptionError(f"no joint moves {tool_frame(arm)!r}, so {arm!r} is no arm")
    last, base = joints[moving[0]].child, joints[moving[-1]].parent
    group = ET.SubElement(root, "group", name=arm)
    ET.SubElement(group, "chain", base_link=base, tip_link=last)
    gripper = ET.SubElement(root, "group", name=_end_effector(arm))
    for joint in reversed(joints[: moving[0]]):
        ET.SubElement(gripper, "link", name=joint.child)
    return last


def _end_effector(arm: str) -> str:
    return f"{arm}_end"
