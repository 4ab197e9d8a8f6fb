"""Reading the description file of one arm: its joints and links from the mount to the flange."""

from dataclasses import replace
from pathlib import Path

from sms_handover.configuration.parameters import read_yaml
from sms_handover.errors import RobotDescriptionError
from sms_handover.frames import joint_name
from sms_handover.model.assembly import link_name
from sms_handover.model.parts import Inertia, JointDescription, LinkDescription, Origin
from sms_handover.model.sections import Section, at, naming, read_list, read_origin, read_section
from sms_handover.model.validation import number, vector


def read_arm_file(file: Path, arm: str) -> tuple[list[JointDescription], list[LinkDescription], Origin]:
    """Return joints, links and flange of an arm's description file, named for one arm."""
    document = read_yaml(file)
    with naming(file):
        root = read_section(document, "arm description", ("joints", "flange"))
        entries = read_list(root["joints"], "joints")
        if not entries:
            raise RobotDescriptionError("joints has 0 entries, allowed is at least 1")
        joints, links = [], []
        for number_from_1, item in enumerate(entries, start=1):
            where = joint_name(arm, number_from_1)
            section = read_section(item, where, ("origin", "axis", "limits", "link"))
            joints.append(_joint(section, where))
            links.append(_link(section["link"], link_name(arm, number_from_1)))
        return joints, links, read_origin(root["flange"], at(root, "flange", "flange"))


def _joint(section: Section, name: str) -> JointDescription:
    """Return one joint; its rotor inertia is for the robot file to give."""
    limits = read_section(section["limits"], f"{name}: limits", ("position", "velocity", "effort"))
    lower, upper = vector(limits["position"], 2, at(limits, "position", f"{name}: position limit"), "rad")
    return JointDescription(
        name=name,
        origin=read_origin(section["origin"], at(section, "origin", f"{name}: origin")),
        axis=vector(section["axis"], 3, at(section, "axis", f"{name}: axis")),
        lower=lower,
        upper=upper,
        velocity=number(limits["velocity"], at(limits, "velocity", f"{name}: velocity limit"), "rad/s"),
        effort=number(limits["effort"], at(limits, "effort", f"{name}: effort limit"), "N m"),
    )


def _link(value: object, name: str) -> LinkDescription:
    """Return one link."""
    section = read_section(value, name, ("mass", "com", "inertia", "radius"))
    inertia = Inertia(
        name,
        number(section["mass"], at(section, "mass", f"{name}: mass"), "kg"),
        vector(section["com"], 3, at(section, "com", f"{name}: com"), "m"),
        vector(section["inertia"], 6, at(section, "inertia", f"{name}: inertia"), "kg m^2"),
    )
    return LinkDescription(
        name, inertia, number(section["radius"], at(section, "radius", f"{name}: radius"), "m")
    )


def override_limits(value: object, joints: list[JointDescription], where: str) -> list[JointDescription]:
    """Return the joints with the limits that the robot file gives for some of them by joint_<number>."""
    known = [f"joint_{number_from_1}" for number_from_1 in range(1, len(joints) + 1)]
    overrides = read_section(value, where, (), optional=known)
    changed = list(joints)
    for key, item in overrides.items():
        index = known.index(key)
        inner = f"{where}: {key}"
        section = read_section(item, inner, (), optional=("position", "velocity", "effort"))
        joint = joints[index]
        before = {"position": (joint.lower, joint.upper), "velocity": joint.velocity, "effort": joint.effort}
        limits = {**before, **section}
        lower, upper = vector(limits["position"], 2, at(limits, "position", f"{inner}: position"), "rad")
        velocity = number(limits["velocity"], at(limits, "velocity", f"{inner}: velocity"), "rad/s")
        effort = number(limits["effort"], at(limits, "effort", f"{inner}: effort"), "N m")
        changed[index] = replace(joint, lower=lower, upper=upper, velocity=velocity, effort=effort)
    return changed
