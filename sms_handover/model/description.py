"""Reading a robot description from its YAML files."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from sms_handover.errors import RobotDescriptionError, UnknownNameError
from sms_handover.frames import BASE, joint_name
from sms_handover.model.parts import (
    ArmDescription,
    Base,
    Floats,
    Gripper,
    Inertia,
    JointDescription,
    LinkDescription,
    Origin,
    Panel,
    RobotDescription,
)
from sms_handover.model.validation import number, positive, vector
from sms_handover.parameters import read_yaml
from sms_handover.share import config_file

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

Section = Mapping[str, object]

_UNIFORM_BOX = "uniform_box"


def load_robot(path: Path | None = None) -> RobotDescription:
    """Return the checked robot that a file describes, by default the shipped ``config/robot.yaml``.

    An arm's own description file is looked for beside the robot file. Raises
    RobotDescriptionError on a key or value that no robot can have and ConfigurationError on a file
    that cannot be read; each message names the file.
    """
    path = config_file("robot.yaml") if path is None else path
    document = read_yaml(path)
    with _blame(path):
        root = _section(document, "robot", ("name", "base", "arms"))
        name = _text(root["name"], "name")
        base = _base(root["base"])
        arms = _list(root["arms"], "arms")
    described = tuple(_arm(item, index, path) for index, item in enumerate(arms))
    with _blame(path):
        return RobotDescription(name, base, described)


def _base(value: object) -> Base:
    section = _section(value, "base", ("mass", "size", "com", "inertia"), optional=("panels",))
    mass = positive(section["mass"], "base: mass", "kg")
    size = vector(section["size"], 3, "base: size", "m")
    com = vector(section["com"], 3, "base: com", "m")
    panels = tuple(
        _panel(item, f"base: panels[{index}]")
        for index, item in enumerate(_list(section.get("panels", []), "base: panels"))
    )
    return Base(Inertia(BASE, mass, com, _base_moments(section["inertia"], mass, size)), size, panels)


def _base_moments(value: object, mass: float, size: Floats) -> Floats:
    """Return the six moments, those of a uniform box being m (b^2 + c^2) / 12."""
    if isinstance(value, str):
        if value != _UNIFORM_BOX:
            raise _unknown("inertia", value, [_UNIFORM_BOX], "base: inertia")
        x2, y2, z2 = (edge**2 for edge in size)
        share = mass / 12.0
        return (share * (y2 + z2), 0.0, 0.0, share * (x2 + z2), 0.0, share * (x2 + y2))
    return vector(value, 6, "base: inertia", "kg m^2")


def _panel(value: object, where: str) -> Panel:
    section = _section(value, where, ("xyz", "size"))
    return Panel(
        vector(section["xyz"], 3, f"{where}: xyz", "m"), vector(section["size"], 3, f"{where}: size", "m")
    )


def _arm(value: object, index: int, path: Path) -> ArmDescription:
    """Return one arm: its own description file, with what the robot file adds or overrides."""
    keys = ("name", "description", "mount", "gripper", "rotor_inertia")
    with _blame(path):
        section = _section(value, f"arms[{index}]", keys, optional=("limits",))
        name = _text(section["name"], f"arms[{index}]: name")
        file = path.parent / _text(section["description"], f"{name}: description")
    joints, links, flange = _read_arm_file(file, name)
    with _blame(path):
        rotor = vector(section["rotor_inertia"], len(joints), f"{name}: rotor_inertia", "kg m^2")
        joints = [replace(joint, rotor_inertia=kg_m2) for joint, kg_m2 in zip(joints, rotor, strict=True)]
        joints = _override_limits(section.get("limits", {}), joints, f"{name}: limits")
        mount = _origin(section["mount"], f"{name}: mount")
        gripper = _gripper(section["gripper"], f"{name}_gripper")
        return ArmDescription(name, mount, tuple(joints), tuple(links), flange, gripper)


def _read_arm_file(file: Path, arm: str) -> tuple[list[JointDescription], list[LinkDescription], Origin]:
    """Return joints, links and flange of an arm's description file, named for one arm."""
    document = read_yaml(file)
    with _blame(file):
        root = _section(document, "arm description", ("name", "joints", "flange"))
        joints, links = [], []
        for number_from_1, item in enumerate(_list(root["joints"], "joints"), start=1):
            where = joint_name(arm, number_from_1)
            section = _section(item, where, ("origin", "axis", "limits", "link"))
            joints.append(_joint(section, where))
            links.append(_link(section["link"], f"{arm}_link_{number_from_1}"))
        return joints, links, _origin(root["flange"], "flange")


def _joint(section: Section, name: str) -> JointDescription:
    limits = _section(section["limits"], f"{name}: limits", ("position", "velocity", "effort"))
    lower, upper = vector(limits["position"], 2, f"{name}: position limit", "rad")
    return JointDescription(
        name=name,
        origin=_origin(section["origin"], f"{name}: origin"),
        axis=vector(section["axis"], 3, f"{name}: axis"),
        lower=lower,
        upper=upper,
        velocity=number(limits["velocity"], f"{name}: velocity limit", "rad/s"),
        effort=number(limits["effort"], f"{name}: effort limit", "N m"),
    )


def _link(value: object, name: str) -> LinkDescription:
    section = _section(value, name, ("mass", "com", "inertia", "radius"))
    inertia = Inertia(
        name,
        number(section["mass"], f"{name}: mass", "kg"),
        vector(section["com"], 3, f"{name}: com", "m"),
        vector(section["inertia"], 6, f"{name}: inertia", "kg m^2"),
    )
    return LinkDescription(name, inertia, number(section["radius"], f"{name}: radius", "m"))


def _gripper(value: object, name: str) -> Gripper:
    section = _section(value, name, ("mass", "radius", "length"))
    return Gripper(
        name,
        number(section["mass"], f"{name}: mass", "kg"),
        number(section["radius"], f"{name}: radius", "m"),
        number(section["length"], f"{name}: length", "m"),
    )


def _override_limits(value: object, joints: list[JointDescription], where: str) -> list[JointDescription]:
    """Return the joints with the limits that the robot file gives for some of them by joint_<number>."""
    known = [f"joint_{number_from_1}" for number_from_1 in range(1, len(joints) + 1)]
    overrides = _section(value, where, (), optional=known)
    changed = list(joints)
    for key, item in overrides.items():
        index = known.index(key)
        inner = f"{where}: {key}"
        section = _section(item, inner, (), optional=("position", "velocity", "effort"))
        joint = joints[index]
        before = {"position": (joint.lower, joint.upper), "velocity": joint.velocity, "effort": joint.effort}
        limits = {**before, **section}
        lower, upper = vector(limits["position"], 2, f"{inner}: position", "rad")
        velocity = number(limits["velocity"], f"{inner}: velocity", "rad/s")
        effort = number(limits["effort"], f"{inner}: effort", "N m")
        changed[index] = replace(joint, lower=lower, upper=upper, velocity=velocity, effort=effort)
    return changed


def _origin(value: object, where: str) -> Origin:
    section = _section(value, where, ("xyz", "rpy"))
    return Origin(
        vector(section["xyz"], 3, f"{where}: xyz", "m"), vector(section["rpy"], 3, f"{where}: rpy", "rad")
    )


def _section(value: object, where: str, required: Sequence[str], optional: Sequence[str] = ()) -> Section:
    """Return ``value`` as a mapping that has every required key and no unknown one."""
    if not isinstance(value, dict):
        raise RobotDescriptionError(f"{where} is {value!r}, expected a mapping")
    known = (*required, *optional)
    for key in value:
        if key not in known:
            raise _unknown("key", key, known, where)
    for key in required:
        if key not in value:
            raise RobotDescriptionError(f"{where}: key {key!r} is missing")
    return value


def _list(value: object, where: str) -> list[object]:
    if not isinstance(value, list):
        raise RobotDescriptionError(f"{where} is {value!r}, expected a list")
    return value


def _text(value: object, where: str) -> str:
    if not isinstance(value, str) or not value:
        raise RobotDescriptionError(f"{where} is {value!r}, expected text")
    return value


def _unknown(kind: str, name: str, known: Sequence[str], where: str) -> RobotDescriptionError:
    """Return the error on a name that is not known, with the nearest one that is."""
    return RobotDescriptionError(str(UnknownNameError(kind, name, known, where)))


@contextmanager
def _blame(path: Path) -> Iterator[None]:
    """Put the file's path before the text of an error raised inside."""
    try:
        yield
    except RobotDescriptionError as error:
        raise RobotDescriptionError(f"{path}: {error}") from error
