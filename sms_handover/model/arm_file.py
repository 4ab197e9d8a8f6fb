"""Arm file: the description of one arm, its joints and links from the mount to the flange."""

from dataclasses import replace
from typing import Any

from sms_handover.configuration.sections import Section
from sms_handover.frames import joint_name
from sms_handover.model.assembly import link_name
from sms_handover.model.parts import Inertia, JointDescription, LinkDescription, Origin

_LIMITS = ("position", "velocity", "effort")


def read_arm(root: Section, arm: str) -> tuple[list[JointDescription], list[LinkDescription], Origin]:
    """Return joints, links and flange of an arm's description, named for one arm."""
    root.only(("joints", "flange"))
    joints, links = [], []
    for number_from_1, section in enumerate(root.sections("joints"), start=1):
        section.only(("origin", "axis", "limits", "link"))
        limits = section.section("limits")
        limits.only(_LIMITS)
        joints.append(_joint(section, limits, joint_name(arm, number_from_1)))
        links.append(_link(section.section("link"), link_name(arm, number_from_1)))
    if not joints:
        raise root.error("joints has 0 entries, must be >= 1", "joints")
    return joints, links, read_origin(root.section("flange"))


def read_origin(section: Section) -> Origin:
    """Return a mapping of ``xyz`` m and ``rpy`` rad as an Origin."""
    section.only(("xyz", "rpy"))
    return Origin(section.vector("xyz", 3, "m"), section.vector("rpy", 3, "rad"))


def override_limits(section: Section, joints: list[JointDescription]) -> list[JointDescription]:
    """Return the joints with the limits that the robot file gives for some of them by joint_<number>."""
    known = [f"joint_{number_from_1}" for number_from_1 in range(1, len(joints) + 1)]
    section.only((), known)
    changed = list(joints)
    for key in section.keys:
        index, limits = known.index(key), section.section(key)
        limits.only((), _LIMITS)
        with limits.located():
            changed[index] = replace(joints[index], **_limits(limits))
    return changed


def _joint(section: Section, limits: Section, name: str) -> JointDescription:
    """Return one joint; its rotor inertia is for the robot file to give."""
    origin, axis = read_origin(section.section("origin")), section.vector("axis", 3)
    values = _limits(limits)
    with section.located():
        return JointDescription(name, origin, axis, **values)


def _limits(section: Section) -> dict[str, Any]:
    """Return those limits of a joint that are given, as fields of a JointDescription."""
    found: dict[str, Any] = {}
    if "position" in section:
        found["lower"], found["upper"] = section.vector("position", 2, "rad")
    if "velocity" in section:
        found["velocity"] = section.number("velocity", "rad/s", above=0.0)
    if "effort" in section:
        found["effort"] = section.number("effort", "N m", above=0.0)
    return found


def _link(section: Section, name: str) -> LinkDescription:
    """Return one link."""
    section.only(("mass", "com", "inertia", "radius"))
    mass, com = section.number("mass", "kg", above=0.0), section.vector("com", 3, "m")
    moments = section.vector("inertia", 6, "kg m^2")
    with section.located("inertia"):
        inertia = Inertia(name, mass, com, moments)
    return LinkDescription(name, inertia, section.number("radius", "m", above=0.0))
