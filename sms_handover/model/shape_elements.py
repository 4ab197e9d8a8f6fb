"""Shape elements of URDF text: solids of a description, and what it says of the pairs that may touch.

URDF has no capsule: one is written as a cylinder, which every reader knows, and named in the element
``collision_checking``, by which Pinocchio reads it as a capsule. The rest is in the element ``sms_handover``,
so that a recording carries all that its clearance depends on but the files of meshes.
"""

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET

from sms_handover.errors import RobotDescriptionError
from sms_handover.model.shapes import (
    Box,
    Capsule,
    ContactPairs,
    Cylinder,
    LinkPair,
    Mesh,
    Shape,
    Shapes,
    Sphere,
)
from sms_handover.model.urdf_values import add_origin, numbers

_OURS = "sms_handover"
_REPLACED, _ALLOW, _COUNT = "replaced", "allow", "count"


def replace_solids(root: ET.Element, shapes: Mapping[str, Shapes]) -> None:
    """Replace the collision elements of some links of a robot."""
    for link in root.iter("link"):
        name = link.get("name", "")
        if name not in shapes:
            continue
        for element in link.findall("collision"):
            link.remove(element)
        for index, shape in enumerate(shapes[name]):
            _collision(link, f"{name}_solid_{index}", shape)


def write_contacts(root: ET.Element, shapes: Iterable[str], contacts: ContactPairs) -> None:
    """Add which links have shapes of their own, and the pairs that count or do not, if there are any."""
    ours = ET.Element(_OURS)
    for link in shapes:
        ET.SubElement(ours, _REPLACED, link=link)
    for tag, pairs in ((_ALLOW, contacts.allow), (_COUNT, contacts.count)):
        for first, second in pairs:
            ET.SubElement(ours, tag, first=first, second=second)
    if len(ours):
        root.append(ours)


def read_replaced(urdf: str) -> frozenset[str]:
    """Return the links whose only solids are their collision elements; raises RobotDescriptionError."""
    return frozenset(element.get("link", "") for element in _elements(urdf, _REPLACED))


def read_contacts(urdf: str) -> ContactPairs:
    """Return the pairs that count or do not; raises RobotDescriptionError if the text is no XML."""
    return ContactPairs(_pairs(urdf, _ALLOW), _pairs(urdf, _COUNT))


def _pairs(urdf: str, tag: str) -> tuple[LinkPair, ...]:
    return tuple((item.get("first", ""), item.get("second", "")) for item in _elements(urdf, tag))


def _elements(urdf: str, tag: str) -> list[ET.Element]:
    """Return the elements of a name in the element of this package."""
    try:
        return ET.fromstring(urdf).findall(f"{_OURS}/{tag}")
    except ET.ParseError as error:
        raise RobotDescriptionError(f"the robot description cannot be read: {error}") from error


def _collision(link: ET.Element, name: str, shape: Shape) -> None:
    """Add a solid to a link."""
    element = ET.SubElement(link, "collision", name=name)
    add_origin(element, shape.origin)
    geometry = ET.SubElement(element, "geometry")
    match shape.geometry:
        case Box(size):
            ET.SubElement(geometry, "box", size=numbers(size))
        case Sphere(radius):
            ET.SubElement(geometry, "sphere", radius=numbers([radius]))
        case Cylinder(radius, length) | Capsule(radius, length):
            ET.SubElement(geometry, "cylinder", radius=numbers([radius]), length=numbers([length]))
        case Mesh(uri, scale):
            ET.SubElement(geometry, "mesh", filename=uri, scale=numbers(scale))
    if isinstance(shape.geometry, Capsule):
        checking = link.find("collision_checking")
        checking = ET.SubElement(link, "collision_checking") if checking is None else checking
        ET.SubElement(checking, "capsule", name=name)
