"""Which columns of a joint array belong to an arm."""

from collections.abc import Sequence

from sms_handover.frames import joint_name


def joints_of(joint_names: Sequence[str], arm: str) -> list[int]:
    """Return the places of an arm's joints, known by their names."""
    prefix = joint_name(arm, 1).removesuffix("1")
    return [place for place, name in enumerate(joint_names) if name.startswith(prefix)]
