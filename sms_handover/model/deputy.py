"""Description of the deputy, the object that is handed over."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from sms_handover.configuration.sections import Section
from sms_handover.model.poses import read_pose
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


def read_deputy(section: Section) -> DeputyDescription:
    """Return the deputy that a section of a file describes; raises the error of the section."""
    mass = section.number("mass")
    if mass != 0.0:
        raise section.error(f"deputy.mass is {mass:g} kg, must be 0: it can only be massless yet", "mass")
    frames = section.section("grasp_frames")
    grasp_frames = {name: read_pose(frames.section(name)) for name in frames.keys}
    in_world = read_pose(section.section("in_world"))
    return DeputyDescription(mass, np.array(section.vector("size")), in_world, grasp_frames)
