"""Tree of links and joints that URDF text describes, with their numbers as written."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from types import MappingProxyType
from xml.etree import ElementTree as ET

from sms_handover.errors import RobotDescriptionError
from sms_handover.frames import tool_frame
from sms_handover.model.parts import Floats, Inertia, Origin
from sms_handover.model.urdf_values import STIFFNESS

FIXED = "fixed"
MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class TreeLink:
    """A link: its inertia in the axes of ``inertia_origin``, None of a massless frame."""

    name: str
    inertia: Inertia | None
    inertia_rpy: Floats
    has_shape: bool


@dataclass(frozen=True)
class TreeJoint:
    """A joint: ``axis`` (3,) in its own frame; limits in rad or m, and N m or N, infinite if not given.

    A passive joint has a spring of ``stiffness`` N m/rad and a damper of ``damping`` N m s/rad, and no motor.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Origin
    axis: Floats
    lower: float
    upper: float
    effort: float
    stiffness: float = 0.0
    damping: float = 0.0

    @property
    def is_passive(self) -> bool:
        """Whether a spring moves the joint, not a motor."""
        return self.stiffness > 0.0


@dataclass(frozen=True)
class UrdfTree:
    """A robot as a tree from its ``root`` link outwards."""

    name: str
    root: str
    links: Mapping[str, TreeLink]
    joints: tuple[TreeJoint, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "links", MappingProxyType(dict(self.links)))

    def below(self, link: str) -> tuple[TreeJoint, ...]:
        """Return the joints that a link carries, in the order of the text."""
        return tuple(joint for joint in self.joints if joint.parent == link)

    def above(self, link: str) -> TreeJoint | None:
        """Return the joint that carries a link, None for the root."""
        return next((joint for joint in self.joints if joint.child == link), None)

    def chain(self, link: str) -> Iterator[TreeJoint]:
        """Yield the joints from a link up to the root."""
        joint = self.above(link)
        while joint is not None:
            yield joint
            joint = self.above(joint.parent)

    @property
    def arms(self) -> tuple[str, ...]:
        """The names of the arms: one per link that is a tool frame."""
        ending = tool_frame("")
        return tuple(link.removesuffix(ending) for link in self.links if link.endswith(ending))


def read_urdf(urdf: str) -> UrdfTree:
    """Return the tree of a description.

    Raises RobotDescriptionError if the text is no URDF, a number is missing or no number, a joint is of
    another kind than fixed, revolute, continuous or prismatic, or the links are not one tree.
    """
    try:
        root = ET.fromstring(urdf)
        links = {link.name: link for link in map(_link, root.findall("link"))}
        joints = tuple(map(_joint, root.findall("joint")))
    except ET.ParseError as error:
        raise RobotDescriptionError(f"the robot description cannot be read: {error}") from error
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise RobotDescriptionError(f"joint {joint.name!r}: there is no link {name!r}")
    children = {joint.child for joint in joints}
    roots = [name for name in links if name not in children]
    tree = UrdfTree(root.get("name", ""), roots[0] if roots else "", links, joints)
    if len(roots) != 1 or len(children) != len(joints) or _reached(tree) != {*links}:
        raise RobotDescriptionError(
            f"the links of a robot must be one tree with one root, its roots are {', '.join(roots) or 'none'}"
        )
    return tree


def _reached(tree: UrdfTree) -> set[str]:
    """Return the links that joints connect to the root."""
    reached, edge = {tree.root}, [tree.root]
    while edge:
        found = [joint.child for joint in tree.below(edge.pop())]
        edge += [link for link in found if link not in reached]
        reached.update(found)
    return reached


def _link(element: ET.Element) -> TreeLink:
    name = element.get("name", "")
    has_shape = element.find("visual") is not None or element.find("collision") is not None
    given = element.find("inertial")
    if given is None:
        return TreeLink(name, None, (0.0, 0.0, 0.0), has_shape)
    origin, keys = _origin(given, name), ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    mass, inertia = _needed(given, "mass", name), _needed(given, "inertia", name)
    moments = tuple(_number(inertia, key, name) for key in keys)
    return TreeLink(
        name, Inertia(name, _number(mass, "value", name), origin.xyz, moments), origin.rpy, has_shape
    )


def _joint(element: ET.Element) -> TreeJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in (FIXED, *MOVING):
        raise RobotDescriptionError(
            f"joint {name!r} is of type {kind!r}, must be {FIXED}, {', '.join(MOVING[:-1])} or {MOVING[-1]}"
        )
    axis, limit, dynamics = (element.find(tag) for tag in ("axis", "limit", "dynamics"))
    stiffness = 0.0 if dynamics is None else _number(dynamics, STIFFNESS, name, 0.0)
    passive = dynamics is not None and stiffness > 0.0
    bounded = limit is not None and kind != "continuous"
    return TreeJoint(
        name,
        kind,
        _needed(element, "parent", name).get("link", ""),
        _needed(element, "child", name).get("link", ""),
        _origin(element, name),
        (1.0, 0.0, 0.0) if axis is None else _vector(axis.get("xyz", "1 0 0"), name),
        _number(limit, "lower", name, 0.0) if limit is not None and bounded else -inf,
        _number(limit, "upper", name, 0.0) if limit is not None and bounded else inf,
        _number(limit, "effort", name, inf) if limit is not None else inf,
        stiffness,
        _number(dynamics, "damping", name, 0.0) if dynamics is not None and passive else 0.0,
    )


def _needed(element: ET.Element, tag: str, name: str) -> ET.Element:
    found = element.find(tag)
    if found is None:
        raise RobotDescriptionError(f"{name!r} has no element {tag!r}")
    return found


def _origin(element: ET.Element, name: str) -> Origin:
    given = element.find("origin")
    if given is None:
        return Origin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return Origin(*(_vector(given.get(key, "0 0 0"), name) for key in ("xyz", "rpy")))


def _vector(text: str, name: str) -> Floats:
    try:
        values = tuple(map(float, text.split()))
    except ValueError as error:
        raise RobotDescriptionError(f"{name!r}: {text!r} must be three numbers") from error
    if len(values) != len("xyz"):
        raise RobotDescriptionError(f"{name!r}: {text!r} must be three numbers")
    return values


def _number(element: ET.Element, key: str, name: str, default: float | None = None) -> float:
    text = element.get(key)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError as error:
        raise RobotDescriptionError(f"{name!r}: {element.tag} {key} is {text!r}, must be a number") from error
