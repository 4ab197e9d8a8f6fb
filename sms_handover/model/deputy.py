"""Description of the deputy, the object that is handed over."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sms_handover.types import Array, Pose, freeze


@dataclass(frozen=True, eq=False)
class DeputyDescription:
    """The deputy: mass kg, edges (3,) m, initial pose, and its grasp frames as poses in it.

    A tool that holds the deputy perfectly coincides with a grasp frame.
    """

    mass: float
    size: Array
    deputy_in_world: Pose
    grasp_frames: Mapping[str, Pose]

    def __post_init__(self) -> None:
        freeze(self, "size")
        object.__setattr__(self, "grasp_frames", MappingProxyType(dict(self.grasp_frames)))
