"""The bodies that can touch each other: spacecraft, panels, links and grippers of the arms, deputy."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

import pinocchio as pin

from sms_handover.frames import BASE, DEPUTY, mount_frame, tool_frame
from sms_handover.model.assembly import gripper_name


class BodyKind(Enum):
    """What a body is a part of."""

    BASE = "base"
    PANEL = "panel"
    LINK = "link"
    GRIPPER = "gripper"
    DEPUTY = "deputy"


@dataclass(frozen=True)
class Body:
    """One solid: its name, what it is a part of, and the arm it belongs to ('' if to none)."""

    name: str
    kind: BodyKind
    arm: str = ""

    @property
    def label(self) -> str:
        """The name of the group that reports count the body to: a gripper, an arm, or the name itself."""
        if self.kind is BodyKind.GRIPPER:
            return f"gripper {self.arm}"
        return self.arm or self.kind.value


DEPUTY_BODY = Body(DEPUTY, BodyKind.DEPUTY)


def bodies_of(model: pin.Model, geometry: pin.GeometryModel, arms: Iterable[str]) -> tuple[Body, ...]:
    """Return what each geometry object is, in their order, named as its link, numbered from the second on."""
    chains = {arm: _links_of(model, arm) for arm in arms}
    names = _names(model.frames[item.parentFrame].name for item in geometry.geometryObjects)
    bodies = []
    for item, name in zip(geometry.geometryObjects, names, strict=True):
        link = model.frames[item.parentFrame].name
        arm = next((arm for arm, links in chains.items() if link in links), "")
        if arm:
            kind = BodyKind.GRIPPER if link == gripper_name(arm) else BodyKind.LINK
        else:
            kind = BodyKind.BASE if link == BASE and name == BASE else BodyKind.PANEL
        bodies.append(Body(name, kind, arm))
    return tuple(bodies)


def _links_of(model: pin.Model, arm: str) -> set[str]:
    """Return the links of an arm: its mount, and what its joints move up to the tool."""
    joint = model.frames[model.getFrameId(tool_frame(arm))].parentJoint
    chain = set(model.supports[joint]) - {0, 1}  # without Pinocchio's universe and the floating base
    moved = {frame.name for frame in model.frames if frame.parentJoint in chain}
    return moved | {mount_frame(arm)}


def _names(links: Iterable[str]) -> Iterator[str]:
    """Yield a name for each solid: that of its link, with a number from the second one of a link on."""
    seen: dict[str, int] = {}
    for link in links:
        seen[link] = seen.get(link, 0) + 1
        yield link if seen[link] == 1 else f"{link}_{seen[link]}"
