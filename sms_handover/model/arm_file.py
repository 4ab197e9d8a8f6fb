"""Arm file: the description of one arm, its joints and links from the mount to the flange."""

from dataclasses import replace
from typing import Any

from sms_handover.configuration.sections import Section
from sms_handover.frames import joint_name
from sms_handover.model.assembly import link_name
from sms_handover.model.parts import Inertia, JointDescription, LinkDescription, Origin


def read_arm(root: Section, arm: str) -> tuple[list[JointDescription], list[LinkDescription], Origin]:
    """Return joints, links and flange of an arm's description, named for one arm."""
    joints, links = [], []
    for number_from_1, section in enumerate(root.sections("joints"), start=1):
        joints.append(_joint(section, joint_name(arm, number_from_1)))
        links.append(_link(section.section("link"), link_name(arm, number_from_1)))
    return joints, links, read_origin(root.section("flange"))


def read_origin(section: Section) -> Origin:
    """Return a mapping of ``xyz`` m and ``rpy`` rad as an Origin."""
    return Origin(section.vector("xyz"), section.vector("rpy"))


def override_limits(section: Section, joints: list[JointDescription]) -> list[JointDescription]:
    """Return the joints with the limits that the robot file gives for some of them by joint_<number>."""
    known = [f"joint_{number_from_1}" for number_from_1 in range(1, len(joints) + 1)]
    section.only((), known)
    changed = list(joints)
    for key in section.keys:
        index, limits = known.index(key), section.section(key)
        with limits.located():
            changed[index] = replace(joints[index], **_limits(limits))
    return changed


def _joint(section: Section, name: str) -> JointDescription:
    """Return one joint; its rotor inertia is for the robot file to give."""
    origin, axis = read_origin(section.section("origin")), section.vector("axis")
    values = _limits(section.section("limits"))
    with section.located():
        return JointDescription(name, origin, axis, **values)


def _limits(section: Section) -> dict[str, Any]:
    """Return those limits of a joint that are given, as fields of a JointDescription."""
    found: dict[str, Any] = {}
    if "position" in section:
        found["lower"], found["upper"] = section.vector("position")
    if "velocity" in section:
        found["velocity"] = section.number("velocity")
    if "effort" in section:
        found["effort"] = section.number("effort")
    return found


def _link(section: Section, name: str) -> LinkDescription:
    """Return one link."""
    mass, com, moments = section.number("mass"), section.vector("com"), section.vector("inertia")
    with section.located("inertia"):
        inertia = Inertia(name, mass, com, moments)
    return LinkDescription(name, inertia, section.number("radius"))
