"""Parts of a robot as plain values, checked when they are made; in SI units and radians."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.model.validation import (
    check_moments,
    check_position_limits,
    check_unit_axis,
    moment_matrix,
    number,
    vector,
)
from sms_handover.types import Array, read_only

Floats = tuple[float, ...]


def box_moments(mass: float, size: Sequence[float]) -> Floats:
    """Return ixx ixy ixz iyy iyz izz of a uniform box, kg m^2: m (b^2 + c^2) / 12 on the diagonal."""
    x2, y2, z2 = (edge**2 for edge in size)
    share = mass / 12.0
    return (share * (y2 + z2), 0.0, 0.0, share * (x2 + z2), 0.0, share * (x2 + y2))


def cylinder_moments(mass: float, radius: float, length: float) -> Floats:
    """Return the six moments of a uniform cylinder along z: m (3 r^2 + l^2) / 12 across, m r^2 / 2 along."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return (across, 0.0, 0.0, across, 0.0, mass * radius**2 / 2.0)


@dataclass(frozen=True)
class Origin:
    """The pose of a frame in its parent: ``xyz`` (3,) m and ``rpy`` (3,) rad about fixed x, y, z."""

    xyz: Floats
    rpy: Floats

    def __post_init__(self) -> None:
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
        number(self.mass, f"{self.body}: mass", "kg", above=0.0)
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
        vector(self.axis, 3, f"{self.name}: axis")
        check_unit_axis(self.axis, f"{self.name}: axis")
        check_position_limits(self.lower, self.upper, f"{self.name}: position limit")
        number(self.velocity, f"{self.name}: velocity limit", "rad/s", above=0.0)
        number(self.effort, f"{self.name}: effort limit", "N m", above=0.0)
        number(self.rotor_inertia, f"{self.name}: rotor inertia", "kg m^2", minimum=0.0)


@dataclass(frozen=True)
class LinkDescription:
    """The body that a joint moves; ``radius`` m is that of the cylinder drawn for it."""

    name: str
    inertia: Inertia
    radius: float

    def __post_init__(self) -> None:
        number(self.radius, f"{self.name}: radius", "m", above=0.0)


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
        number(self.mass, f"{self.name}: mass", "kg", above=0.0)
        number(self.radius, f"{self.name}: radius", "m", above=0.0)
        number(self.length, f"{self.name}: length", "m", above=0.0)

    @property
    def inertia(self) -> Inertia:
        """Inertia in the frame of the flange."""
        com = (0.0, 0.0, self.length / 2.0)
        return Inertia(self.name, self.mass, com, cylinder_moments(self.mass, self.radius, self.length))

    @property
    def tool(self) -> Origin:
        """The tool frame in the frame of the flange."""
        return Origin((0.0, 0.0, self.length), (0.0, 0.0, 0.0))
