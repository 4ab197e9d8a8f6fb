"""Shape section ``clearance`` of a robot description: solids in place of what is drawn, pairs that count."""

from pathlib import Path
from urllib.parse import unquote, urlsplit

from sms_handover.configuration.sections import Section
from sms_handover.model.arm_file import read_origin
from sms_handover.model.shapes import (
    AT_ORIGIN,
    Box,
    Capsule,
    ContactPairs,
    Cylinder,
    Geometry,
    LinkPair,
    Mesh,
    Shape,
    Shapes,
    Sphere,
)


def read_shapes(section: Section) -> dict[str, Shapes]:
    """Return the solids in a section ``clearance`` by link; raises RobotDescriptionError."""
    if "shapes" not in section:
        return {}
    links = section.section("shapes")
    return {link: tuple(map(_shape, links.sections(link))) for link in links.keys}


def read_contact_pairs(section: Section) -> ContactPairs:
    """Return the pairs of links in a section ``clearance``; raises RobotDescriptionError."""
    return ContactPairs(*(_pairs(section, key) for key in ("allow", "count")))


def _shape(section: Section) -> Shape:
    """Return one shape: exactly one kind, and an origin unless it is that of the link."""
    kind = section.one_of("a shape")
    origin = read_origin(section.section("origin")) if "origin" in section else AT_ORIGIN
    return Shape(_geometry(section, kind), origin)


def _geometry(section: Section, kind: str) -> Geometry:
    if kind == "box":
        return Box(section.vector("box"))
    inner = section.section(kind)
    if kind == "mesh":
        scale = inner.vector("scale") if "scale" in inner else (1.0, 1.0, 1.0)
        return Mesh(_uri(inner), scale)
    if kind == "sphere":
        return Sphere(inner.number("radius"))
    radius, length = inner.number("radius"), inner.number("length")
    return Cylinder(radius, length) if kind == "cylinder" else Capsule(radius, length)


def _uri(section: Section) -> str:
    """Return the URI of a mesh file, which must be there unless it is of a package."""
    uri = section.text("file")
    try:
        parts = urlsplit(uri)
    except ValueError as error:
        raise section.error(
            f"{section.path('file')} is {uri!r}, must be a path or a URI: {error}", "file"
        ) from error
    if parts.scheme == "file" and not Path(unquote(parts.path)).is_file():
        raise section.error(f"{section.path('file')}: there is no mesh file {unquote(parts.path)}", "file")
    return uri


def _pairs(section: Section, key: str) -> tuple[LinkPair, ...]:
    """Return the pairs of link names in the list of a key."""
    if key not in section:
        return ()
    pairs = section.value(key)
    if not isinstance(pairs, list):
        raise section.error(f"{section.path(key)} must be a list of pairs of links", key)
    for pair in pairs:
        if not (isinstance(pair, list) and len(pair) == 2 and all(isinstance(link, str) for link in pair)):
            raise section.error(f"{section.path(key)} has {pair!r}, must be pairs of two links", key)
    return tuple((str(first), str(second)) for first, second in pairs)
