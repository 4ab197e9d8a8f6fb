"""Reading a robot description from its YAML files."""

from dataclasses import replace
from pathlib import Path

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import read_yaml
from sms_handover.frames import BASE
from sms_handover.model.arm_file import override_limits, read_arm_file
from sms_handover.model.assembly import ArmDescription, Base, Panel, RobotDescription, gripper_name
from sms_handover.model.parts import (
    Floats,
    Gripper,
    Inertia,
    JointDescription,
    LinkDescription,
    Origin,
    box_moments,
)
from sms_handover.model.sections import at, naming, read_list, read_origin, read_section, read_text, unknown
from sms_handover.model.validation import number, positive, positive_vector, vector

__all__ = [
    "ArmDescription",
    "Base",
    "Gripper",
    "Inertia",
    "JointDescription",
    "LinkDescription",
    "Origin",
    "Panel",
    "RobotDescription",
    "load_robot",
]

_UNIFORM_BOX = "uniform_box"


def load_robot(path: Path | None = None) -> RobotDescription:
    """Return the checked robot that a file describes, by default the shipped ``config/robot.yaml``.

    The path of an arm's own description file is relative to the robot file. Raises
    RobotDescriptionError on a key or value that no robot can have and ConfigurationError on a file
    that cannot be read; each message names the file.
    """
    path = config_file("robot.yaml") if path is None else path
    document = read_yaml(path)
    with naming(path):
        root = read_section(document, "robot", ("name", "base", "arms"))
        name = read_text(root["name"], at(root, "name", "name"))
        base = _base(root["base"])
        arms = read_list(root["arms"], "arms")
    described = tuple(_arm(item, index, path) for index, item in enumerate(arms))
    with naming(path):
        return RobotDescription(name, base, described)


def _base(value: object) -> Base:
    """Return the spacecraft."""
    section = read_section(value, "base", ("mass", "size", "com", "inertia"), optional=("panels",))
    mass = positive(section["mass"], at(section, "mass", "base: mass"), "kg")
    size = positive_vector(section["size"], 3, at(section, "size", "base: size"), "m")
    com = vector(section["com"], 3, at(section, "com", "base: com"), "m")
    panels = tuple(
        _panel(item, f"base: panels[{index}]")
        for index, item in enumerate(read_list(section.get("panels", []), "base: panels"))
    )
    return Base(Inertia(BASE, mass, com, _base_moments(section["inertia"], mass, size)), size, panels)


def _base_moments(value: object, mass: float, size: Floats) -> Floats:
    """Return the six moments given, or those of a uniform box."""
    if isinstance(value, str):
        if value != _UNIFORM_BOX:
            raise unknown("inertia", value, [_UNIFORM_BOX], "base: inertia")
        return box_moments(mass, size)
    return vector(value, 6, "base: inertia", "kg m^2")


def _panel(value: object, where: str) -> Panel:
    """Return one solar panel."""
    section = read_section(value, where, ("xyz", "size"))
    xyz = vector(section["xyz"], 3, at(section, "xyz", f"{where}: xyz"), "m")
    return Panel(xyz, positive_vector(section["size"], 3, at(section, "size", f"{where}: size"), "m"))


def _arm(value: object, index: int, path: Path) -> ArmDescription:
    """Return one arm: its own description file, with what the robot file adds or overrides."""
    keys = ("name", "description", "mount", "gripper", "rotor_inertia")
    with naming(path):
        section = read_section(value, f"arms[{index}]", keys, optional=("limits",))
        name = read_text(section["name"], at(section, "name", f"arms[{index}]: name"))
        file = path.parent / read_text(
            section["description"], at(section, "description", f"{name}: description")
        )
    joints, links, flange = read_arm_file(file, name)
    with naming(path):
        rotor = vector(
            section["rotor_inertia"],
            len(joints),
            at(section, "rotor_inertia", f"{name}: rotor_inertia"),
            "kg m^2",
        )
        joints = [replace(joint, rotor_inertia=kg_m2) for joint, kg_m2 in zip(joints, rotor, strict=True)]
        joints = override_limits(section.get("limits", {}), joints, f"{name}: limits")
        mount = read_origin(section["mount"], at(section, "mount", f"{name}: mount"))
        gripper = _gripper(section["gripper"], gripper_name(name))
        return ArmDescription(name, mount, tuple(joints), tuple(links), flange, gripper)


def _gripper(value: object, name: str) -> Gripper:
    """Return the gripper of an arm."""
    section = read_section(value, name, ("mass", "radius", "length"))
    return Gripper(
        name,
        number(section["mass"], at(section, "mass", f"{name}: mass"), "kg"),
        number(section["radius"], at(section, "radius", f"{name}: radius"), "m"),
        number(section["length"], at(section, "length", f"{name}: length"), "m"),
    )
