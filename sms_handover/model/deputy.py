"""The description of the deputy: the object that changes hands."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sms_handover.types import Array, Pose, read_only


@dataclass(frozen=True, eq=False)
class DeputyDescription:
    """The deputy: mass kg, edges (3,) m, where it starts, and its grasp frames as poses in it.

    A tool that holds the deputy perfectly coincides with a grasp frame.
    """

    mass: float
    size: Array
    deputy_in_world: Pose
    grasp_frames: Mapping[str, Pose]

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "size", read_only(self.size))
        object.__setattr__(self, "grasp_frames", MappingProxyType(dict(self.grasp_frames)))
