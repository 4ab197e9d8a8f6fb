"""Description of a robot, read from its YAML files."""

from dataclasses import replace
from pathlib import Path

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.robot_content import read_robot_content
from sms_handover.configuration.robot_fields import ROBOT_FIELDS, UNIFORM_BOX
from sms_handover.configuration.sections import Section
from sms_handover.configuration.yaml_reader import Mapping
from sms_handover.errors import RobotDescriptionError
from sms_handover.frames import BASE
from sms_handover.model.arm_file import override_limits, read_arm, read_origin
from sms_handover.model.assembly import ArmDescription, Base, RobotDescription, gripper_name
from sms_handover.model.panels import Hinge, Panel
from sms_handover.model.parts import Floats, Gripper, Inertia, box_moments
from sms_handover.model.shape_section import read_contact_pairs, read_shapes


def load_robot(path: Path | None = None) -> RobotDescription:
    """Return the checked robot that a file describes, by default the shipped ``config/robot.yaml``.

    The path of an arm's own description file is relative to the robot file. Raises what :func:`robot_of`
    does, and ConfigurationError on a file that cannot be read.
    """
    return robot_of(read_robot_content(config_file("robot.yaml") if path is None else path))


def robot_of(content: Mapping) -> RobotDescription:
    """Return the checked robot that the content of a robot file describes.

    Raises RobotDescriptionError on a key or value that no robot can have, with file and line.
    """
    root = Section(content, Path(), RobotDescriptionError, spec=ROBOT_FIELDS)
    name, base = root.text("name"), _base(root.section("base"))
    arms = tuple(map(_arm, root.sections("arms")))
    with root.located("arms"):
        robot = RobotDescription(name, base, arms)
    if "clearance" not in root:
        return robot
    section = root.section("clearance")
    with section.located():
        return replace(robot, shapes=read_shapes(section), contacts=read_contact_pairs(section))


def _base(section: Section) -> Base:
    """Return the spacecraft."""
    mass, size = section.number("mass"), section.vector("size")
    com, moments = section.vector("com"), _base_moments(section, mass, size)
    with section.located("inertia"):
        inertia = Inertia(BASE, mass, com, moments)
    panels = section.sections("panels") if "panels" in section else ()
    return Base(inertia, size, tuple(map(_panel, panels)))


def _panel(section: Section) -> Panel:
    """Return one panel."""
    xyz, size = section.vector("xyz"), section.vector("size")
    if "flexible" not in section:
        return Panel(xyz, size)
    inner = section.section("flexible")
    damping = inner.number("damping", 0.0)
    hinge = inner.vector("hinge"), inner.vector("axis"), inner.number("stiffness"), damping
    with inner.located():
        return Panel(xyz, size, inner.number("mass"), Hinge(*hinge))


def _base_moments(section: Section, mass: float, size: Floats) -> Floats:
    """Return the six moments given, or those of a uniform box."""
    if isinstance(section.value("inertia"), str):
        section.name("inertia", "inertia", [UNIFORM_BOX])
        return box_moments(mass, size)
    return section.vector("inertia")


def _arm(section: Section) -> ArmDescription:
    """Return one arm: its own description file, with what the robot file adds or overrides."""
    name = section.text("name")
    joints, links, flange = read_arm(section.section("description"), name)
    rotor = section.vector("rotor_inertia", len(joints))
    with section.located("rotor_inertia"):
        joints = [replace(joint, rotor_inertia=kg_m2) for joint, kg_m2 in zip(joints, rotor, strict=True)]
    if "limits" in section:
        joints = override_limits(section.section("limits"), joints)
    mount, gripper = read_origin(section.section("mount")), _gripper(section.section("gripper"), name)
    with section.located("name"):
        return ArmDescription(name, mount, tuple(joints), tuple(links), flange, gripper)


def _gripper(section: Section, arm: str) -> Gripper:
    """Return the gripper of an arm."""
    return Gripper(
        gripper_name(arm), section.number("mass"), section.number("radius"), section.number("length")
    )
