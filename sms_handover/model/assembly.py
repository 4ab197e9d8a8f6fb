"""Assembly of parts to arms, and of arms and a spacecraft to the robot, checked when it is made."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from re import fullmatch
from types import MappingProxyType

from sms_handover.errors import RobotDescriptionError, UnknownNameError
from sms_handover.frames import BASE, DEPUTY, joint_name, mount_frame, tool_frame
from sms_handover.model.panels import FlexiblePanel, Panel, flexible_panels
from sms_handover.model.parts import Floats, Gripper, Inertia, JointDescription, LinkDescription, Origin
from sms_handover.model.shapes import ContactPairs, Shapes
from sms_handover.model.validation import vector


def link_name(arm: str, number: int) -> str:
    """Return the name of the link that joint ``number`` of an arm moves."""
    return f"{arm}_link_{number}"


def gripper_name(arm: str) -> str:
    """Return the name of an arm's gripper link, whose frame is the arm's flange."""
    return f"{arm}_gripper"


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
        if not fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise RobotDescriptionError(
                f"arm name is {self.name!r}, must be lower-case letters, digits and _, a letter first"
            )
        if not self.joints:
            raise RobotDescriptionError(f"{self.name}: has 0 joints, must be >= 1")
        if len(self.joints) != len(self.links):
            counts = f"{len(self.joints)} joints and {len(self.links)} links"
            raise RobotDescriptionError(f"{self.name}: has {counts}, must be equal numbers")
        parts = [(self.gripper.name, gripper_name(self.name))]
        for number, (joint, link) in enumerate(zip(self.joints, self.links, strict=True), start=1):
            parts += (joint.name, joint_name(self.name, number)), (link.name, link_name(self.name, number))
        for name, expected in parts:
            if name != expected:
                raise RobotDescriptionError(f"{self.name}: a part is named {name!r}, must be {expected!r}")

    @property
    def mass(self) -> float:
        """Mass in kg of links and gripper."""
        return sum(link.inertia.mass for link in self.links) + self.gripper.mass


@dataclass(frozen=True)
class Base:
    """The spacecraft body: its inertia in ``base_link``, edges (3,) m of the box drawn for it, its panels."""

    inertia: Inertia
    size: Floats
    panels: tuple[Panel, ...] = ()

    def __post_init__(self) -> None:
        vector(self.size, 3, f"{self.inertia.body}: size", "m", above=0.0)


@dataclass(frozen=True)
class RobotDescription:
    """A free-floating spacecraft with one or more arms, in the order of the file.

    ``shapes`` has the solids of some links by name, in place of what is drawn for them, and ``contacts``
    the pairs of links, or of a link and the deputy, whose contact counts, or does not, whatever is derived.
    """

    name: str
    base: Base
    arms: tuple[ArmDescription, ...]
    shapes: Mapping[str, Shapes] = field(default_factory=dict)
    contacts: ContactPairs = field(default_factory=ContactPairs)

    def __post_init__(self) -> None:
        object.__setattr__(self, "shapes", MappingProxyType(dict(self.shapes)))
        if not self.arms:
            raise RobotDescriptionError("the robot has 0 arms, must be >= 1")
        name, count = Counter(arm.name for arm in self.arms).most_common(1)[0]
        if count > 1:
            raise RobotDescriptionError(f"arm name {name!r} is given {count} times")
        named = [link for pair in (*self.contacts.allow, *self.contacts.count) for link in pair]
        for links, known in ((self.shapes, self.link_names), (named, (*self.link_names, DEPUTY))):
            for link in links:
                if link not in known:
                    raise RobotDescriptionError(str(UnknownNameError("link", link, known)))

    @property
    def link_names(self) -> tuple[str, ...]:
        """The names of all links, those of frames without a body included."""
        names = [BASE, *(panel.link for panel in self.flexible_panels)]
        for arm in self.arms:
            links = (link.name for link in arm.links)
            names += [mount_frame(arm.name), *links, arm.gripper.name, tool_frame(arm.name)]
        return tuple(names)

    @property
    def flexible_panels(self) -> tuple[FlexiblePanel, ...]:
        """The panels on hinges with a spring and a damper."""
        return flexible_panels(self.base.panels)

    @property
    def rotor_inertia(self) -> dict[str, float]:
        """What the motor adds at each joint, kg m^2 by name: a URDF has no place for it."""
        return {joint.name: joint.rotor_inertia for arm in self.arms for joint in arm.joints}

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        panels = sum(panel.panel.mass for panel in self.flexible_panels)
        return self.base.inertia.mass + panels + sum(arm.mass for arm in self.arms)
