"""Declared contacts: which group of bodies a pair counts to, and when gripper and deputy may touch.

One rule for the clearance of a run while it goes on and of a recorded one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from sms_handover.clearance.bodies import Body, BodyKind

CONTACT_DEPTH = 0.001  # [m] by which gripper and deputy may enter each other in a declared contact


class Stage(Enum):
    """Where an arm is in its dealings with the deputy; the value is what a user reads."""

    BEFORE = "before grasp"
    HELD = "held"
    AFTER = "after release"


@dataclass(frozen=True)
class Group:
    """The bodies that reports count together; ``contact`` is declared between gripper and deputy."""

    name: str
    contact: bool = False

    @property
    def label(self) -> str:
        """The name, with a mark of a declared contact."""
        return f"{self.name} (contact)" if self.contact else self.name

    def allowed(self, contact_depth: float) -> float:
        """Return what the signed distance must not be less than, m."""
        return -contact_depth if self.contact else 0.0


def may_touch(one: Body, other: Body) -> bool:
    """Whether contact of two bodies can be declared: a gripper and the deputy."""
    return {one.kind, other.kind} == {BodyKind.GRIPPER, BodyKind.DEPUTY}


def group_of(one: Body, other: Body) -> Group:
    """Return the group of two bodies between which no contact can be declared."""
    grippers = one.kind is other.kind is BodyKind.GRIPPER
    first, second = (body.label if grippers else body.arm or body.label for body in (one, other))
    return Group(f"{first} - {second}" if first != second else f"{first} itself")


@dataclass
class GraspContact:
    """Whether a body of an arm's gripper may touch the deputy, from one reference period to the next.

    Contact is declared while the arm goes to a grasp frame or holds the deputy, and then until the two have
    come apart.
    """

    arm: str
    declared: bool = False
    has_held: bool = False

    def advance(self, distance: float, *, aims: bool, holds: bool) -> Group:
        """Return the group of the pair in a period with this signed distance, m."""
        self.declared = aims or holds or (self.declared and distance <= 0.0)
        self.has_held = self.has_held or holds
        stage = Stage.HELD if holds else Stage.AFTER if self.has_held else Stage.BEFORE
        return Group(f"gripper {self.arm} - deputy, {stage.value}", self.declared)


def contacts_of(pairs: Sequence[tuple[Body, Body]]) -> dict[int, GraspContact]:
    """Return the contacts that can be declared, by the index of their pair."""
    return {
        index: GraspContact(one.arm or other.arm)
        for index, (one, other) in enumerate(pairs)
        if may_touch(one, other)
    }


def fixed_groups(pairs: Sequence[tuple[Body, Body]]) -> dict[Group, list[int]]:
    """Return the indices of the other pairs by their group."""
    groups: dict[Group, list[int]] = {}
    for index, (one, other) in enumerate(pairs):
        if not may_touch(one, other):
            groups.setdefault(group_of(one, other), []).append(index)
    return groups
