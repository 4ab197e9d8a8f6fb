"""The parts of a robot as plain values; every part that exists has been checked.

Numbers are in SI units and radians; tuples keep the parts comparable and immutable.
"""

from collections import Counter
from dataclasses import dataclass
from re import fullmatch

from sms_handover.errors import RobotDescriptionError, UnknownNameError
from sms_handover.model.validation import (
    check_moments,
    check_position_limits,
    check_unit_axis,
    moment_matrix,
    not_negative,
    positive,
    vector,
)
from sms_handover.types import Array, read_only

Floats = tuple[float, ...]


@dataclass(frozen=True)
class Origin:
    """Where a frame lies in its parent: ``xyz`` (3,) m and ``rpy`` (3,) rad about fixed x, y, z."""

    xyz: Floats
    rpy: Floats

    def __post_init__(self) -> None:
        """Check lengths and values."""
        vector(self.xyz, 3, "origin xyz", "m")
        vector(self.rpy, 3, "origin rpy", "rad")


@dataclass(frozen=True)
class Inertia:
    """Mass kg, centre of mass (3,) m in the body's frame, and moments (6,) kg m^2 about it.

    ``moments`` are ixx ixy ixz iyy iyz izz in the axes of the body's frame. Raises
    RobotDescriptionError, naming ``body``, unless they belong to a real body.
    """

    body: str
    mass: float
    com: Floats
    moments: Floats

    def __post_init__(self) -> None:
        """Check that the inertia is physical."""
        positive(self.mass, f"{self.body}: mass", "kg")
        vector(self.com, 3, f"{self.body}: com", "m")
        vector(self.moments, 6, f"{self.body}: inertia", "kg m^2")
        check_moments(self.moments, f"{self.body}: inertia")

    @property
    def matrix(self) -> Array:
        """The moments as a symmetric (3, 3) matrix, kg m^2."""
        return read_only(moment_matrix(self.moments))


@dataclass(frozen=True)
class JointDescription:
    """A revolute joint: ``origin`` in the link before it, unit ``axis`` (3,) in its own frame.

    ``lower`` and ``upper`` rad, ``velocity`` rad/s and ``effort`` N m are limits; ``rotor_inertia``
    kg m^2 is what the motor adds at the joint (rotor inertia times gear ratio squared).
    """

    name: str
    origin: Origin
    axis: Floats
    lower: float
    upper: float
    velocity: float
    effort: float
    rotor_inertia: float = 0.0

    def __post_init__(self) -> None:
        """Check axis and limits."""
        vector(self.axis, 3, f"{self.name}: axis")
        check_unit_axis(self.axis, f"{self.name}: axis")
        check_position_limits(self.lower, self.upper, f"{self.name}: position limit")
        positive(self.velocity, f"{self.name}: velocity limit", "rad/s")
        positive(self.effort, f"{self.name}: effort limit", "N m")
        not_negative(self.rotor_inertia, f"{self.name}: rotor inertia", "kg m^2")


@dataclass(frozen=True)
class LinkDescription:
    """The body that a joint moves; ``radius`` m is that of the cylinder drawn for it."""

    name: str
    inertia: Inertia
    radius: float

    def __post_init__(self) -> None:
        """Check the radius."""
        positive(self.radius, f"{self.name}: radius", "m")


@dataclass(frozen=True)
class Gripper:
    """A rigid uniform cylinder on the flange, along its z axis from the flange to the tool frame.

    ``mass`` kg, ``radius`` m, ``length`` m. The tool frame has the axes of the flange.
    """

    name: str
    mass: float
    radius: float
    length: float

    def __post_init__(self) -> None:
        """Check mass and dimensions."""
        positive(self.mass, f"{self.name}: mass", "kg")
        positive(self.radius, f"{self.name}: radius", "m")
        positive(self.length, f"{self.name}: length", "m")

    @property
    def inertia(self) -> Inertia:
        """Inertia in the frame of the flange: m (3 r^2 + l^2) / 12 across and m r^2 / 2 along z."""
        across = self.mass * (3.0 * self.radius**2 + self.length**2) / 12.0
        along = self.mass * self.radius**2 / 2.0
        com = (0.0, 0.0, self.length / 2.0)
        return Inertia(self.name, self.mass, com, (across, 0.0, 0.0, across, 0.0, along))

    @property
    def tool(self) -> Origin:
        """Where the tool frame lies in the frame of the flange."""
        return Origin((0.0, 0.0, self.length), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class ArmDescription:
    """A serial arm: ``links[i]`` is moved by ``joints[i]``, counted from the mount outwards.

    ``mount`` is the arm's root frame in ``base_link``, ``flange`` lies in the last link.
    """

    name: str
    mount: Origin
    joints: tuple[JointDescription, ...]
    links: tuple[LinkDescription, ...]
    flange: Origin
    gripper: Gripper

    def __post_init__(self) -> None:
        """Check that the name can be part of a topic and that joints and links pair up."""
        if not fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise RobotDescriptionError(
                f"arm name is {self.name!r}, allowed are lower-case letters, digits and _, a letter first"
            )
        if not self.joints:
            raise RobotDescriptionError(f"{self.name}: has 0 joints, allowed is at least 1")
        if len(self.joints) != len(self.links):
            counts = f"{len(self.joints)} joints and {len(self.links)} links"
            raise RobotDescriptionError(f"{self.name}: has {counts}, allowed are equal numbers")

    @property
    def mass(self) -> float:
        """Mass in kg of links and gripper."""
        return sum(link.inertia.mass for link in self.links) + self.gripper.mass

    @property
    def rotor_inertia(self) -> Floats:
        """Reflected rotor inertia of every joint, kg m^2."""
        return tuple(joint.rotor_inertia for joint in self.joints)


@dataclass(frozen=True)
class Panel:
    """A box that is drawn on the spacecraft and has no mass: centre (3,) m in ``base_link``, edges (3,) m."""

    xyz: Floats
    size: Floats

    def __post_init__(self) -> None:
        """Check position and size."""
        vector(self.xyz, 3, "panel xyz", "m")
        for edge in vector(self.size, 3, "panel size", "m"):
            positive(edge, "panel size", "m")


@dataclass(frozen=True)
class Base:
    """The spacecraft body: its inertia in ``base_link``, edges (3,) m of the box drawn for it, its panels."""

    inertia: Inertia
    size: Floats
    panels: tuple[Panel, ...] = ()

    def __post_init__(self) -> None:
        """Check the size."""
        for edge in vector(self.size, 3, f"{self.inertia.body}: size", "m"):
            positive(edge, f"{self.inertia.body}: size", "m")


@dataclass(frozen=True)
class RobotDescription:
    """A free-floating spacecraft with one or more arms, in the order of the file."""

    name: str
    base: Base
    arms: tuple[ArmDescription, ...]

    def __post_init__(self) -> None:
        """Check that there is an arm and that arm names differ."""
        if not self.arms:
            raise RobotDescriptionError("the robot has 0 arms, allowed is at least 1")
        name, count = Counter(arm.name for arm in self.arms).most_common(1)[0]
        if count > 1:
            raise RobotDescriptionError(f"arm name {name!r} is given {count} times, allowed is once")

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        return self.base.inertia.mass + sum(arm.mass for arm in self.arms)

    def arm(self, name: str) -> ArmDescription:
        """Return the arm of a name; raises UnknownNameError."""
        for arm in self.arms:
            if arm.name == name:
                return arm
        raise UnknownNameError("arm", name, [arm.name for arm in self.arms])
