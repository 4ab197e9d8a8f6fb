"""Joints of an arm: their columns in a joint array."""

from collections.abc import Sequence

from sms_handover.frames import arm_of_joint


def joints_of(joint_names: Sequence[str], arm: str) -> list[int]:
    """Return the columns of an arm's joints, known by their names."""
    return [place for place, name in enumerate(joint_names) if arm_of_joint(name) == arm]
