"""Joints of an arm: their columns in a joint array, and figures with a value per joint."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

from sms_handover.frames import arm_of_joint

F = TypeVar("F", bound="JointFigures")


def joints_of(joint_names: Sequence[str], arm: str) -> list[int]:
    """Return the columns of an arm's joints, known by their names."""
    return [place for place, name in enumerate(joint_names) if arm_of_joint(name) == arm]


@dataclass(frozen=True, eq=False)
class JointFigures:
    """Figures of joints: every other field is an array (n,) in the order of ``joint_names``."""

    joint_names: tuple[str, ...]

    def __post_init__(self) -> None:
        for item in fields(self)[1:]:
            getattr(self, item.name).setflags(write=False)

    def of_arm(self: F, arm: str) -> F:
        """Return the same for the joints of one arm."""
        chosen = joints_of(self.joint_names, arm)
        arrays = (getattr(self, item.name)[chosen] for item in fields(self)[1:])
        return type(self)(tuple(self.joint_names[place] for place in chosen), *arrays)
