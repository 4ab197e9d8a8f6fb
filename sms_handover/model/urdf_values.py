"""Values in URDF text: numbers, and origins of elements."""

from collections.abc import Iterable
from xml.etree import ElementTree as ET

from sms_handover.model.parts import Origin

STIFFNESS = "spring_stiffness"  # attribute of the dynamics of a joint with a spring, N m/rad; as SDF names it


def add_origin(parent: ET.Element, origin: Origin) -> None:
    """Place an element in the frame of its link."""
    ET.SubElement(parent, "origin", xyz=numbers(origin.xyz), rpy=numbers(origin.rpy))


def numbers(values: Iterable[float]) -> str:
    """Return the values with as many digits as it takes to read them back exactly."""
    return " ".join(repr(float(value)) for value in values)
