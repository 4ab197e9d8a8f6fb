"""Shapes of bodies for collisions, checked when made, and the pairs of links whose contact counts or not."""

from dataclasses import dataclass

from sms_handover.model.parts import Floats, Origin
from sms_handover.model.validation import number, vector

AT_ORIGIN = Origin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Box:
    """A box with edges ``size`` (3,) m about its origin."""

    size: Floats

    def __post_init__(self) -> None:
        vector(self.size, 3, "box size", "m", above=0.0)


@dataclass(frozen=True)
class Sphere:
    """A sphere of ``radius`` m."""

    radius: float

    def __post_init__(self) -> None:
        number(self.radius, "sphere radius", "m", above=0.0)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder of ``radius`` m and ``length`` m along z, its middle in the origin."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        number(self.radius, "cylinder radius", "m", above=0.0)
        number(self.length, "cylinder length", "m", above=0.0)


@dataclass(frozen=True)
class Capsule:
    """All points within ``radius`` m of a line of ``length`` m along z, its middle in the origin."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        number(self.radius, "capsule radius", "m", above=0.0)
        number(self.length, "capsule length", "m", above=0.0)


@dataclass(frozen=True)
class Mesh:
    """The convex hull of a mesh in the file that ``uri`` names, its coordinates times ``scale`` (3,)."""

    uri: str
    scale: Floats = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        vector(self.scale, 3, "mesh scale", above=0.0)


Geometry = Box | Sphere | Cylinder | Capsule | Mesh


@dataclass(frozen=True)
class Shape:
    """One solid of a link, at an origin in the link's frame."""

    geometry: Geometry
    origin: Origin = AT_ORIGIN


Shapes = tuple[Shape, ...]
LinkPair = tuple[str, str]


@dataclass(frozen=True)
class ContactPairs:
    """Pairs of links whose distance does not count (``allow``) or does (``count``), whatever is derived."""

    allow: tuple[LinkPair, ...] = ()
    count: tuple[LinkPair, ...] = ()

    def allows(self, first: str, second: str) -> bool:
        """Whether the contact of two links is said not to count."""
        return (first, second) in self.allow or (second, first) in self.allow

    def counts(self, first: str, second: str) -> bool:
        """Whether the contact of two links is said to count."""
        return (first, second) in self.count or (second, first) in self.count
