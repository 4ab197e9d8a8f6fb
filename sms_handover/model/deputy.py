"""Description of the deputy, the object that is handed over."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from sms_handover.configuration.robot_fields import UNIFORM_BOX
from sms_handover.configuration.sections import Section
from sms_handover.errors import RobotDescriptionError
from sms_handover.frames import DEPUTY
from sms_handover.model.parts import Floats, Inertia, box_moments
from sms_handover.model.poses import read_pose
from sms_handover.types import Array, Pose, Twist, freeze

_LEAST_MASS = 1e-9  # [kg] below, a deputy is as good as massless and its inertia lost in rounding
_AT_REST = Twist(np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class DeputyDescription:
    """The deputy: edges (3,) m, initial pose, its grasp frames as poses in it, and what it weighs.

    A tool that holds the deputy perfectly coincides with a grasp frame. ``body`` has mass, centre of mass and
    moments in the deputy, None without mass; ``twist_in_world`` is that of its origin at time zero.
    """

    size: Array
    deputy_in_world: Pose
    grasp_frames: Mapping[str, Pose]
    body: Inertia | None = None
    twist_in_world: Twist = _AT_REST

    def __post_init__(self) -> None:
        freeze(self, "size")
        object.__setattr__(self, "grasp_frames", MappingProxyType(dict(self.grasp_frames)))

    @property
    def mass(self) -> float:
        """The mass in kg."""
        return self.body.mass if self.body else 0.0

    @property
    def inertia(self) -> pin.Inertia | None:
        """The spatial inertia in the deputy, None without mass."""
        body = self.body
        return pin.Inertia(body.mass, np.array(body.com), np.array(body.matrix)) if body else None


def read_deputy(section: Section) -> DeputyDescription:
    """Return the deputy that a section of a file describes; raises the error of the section."""
    size, frames = section.vector("size"), section.section("grasp_frames")
    grasp_frames = {name: read_pose(frames.section(name)) for name in frames.keys}
    in_world = read_pose(section.section("in_world"))
    body = _read_body(section, size)
    return DeputyDescription(np.array(size), in_world, grasp_frames, body, _read_twist(section))


def _read_body(section: Section, size: Floats) -> Inertia | None:
    """Return mass, centre of mass and moments, None without mass."""
    mass = section.number("mass")
    if mass == 0.0:
        return None
    if mass < _LEAST_MASS:
        allowed = f"must be 0 (massless) or at least {_LEAST_MASS:g} kg"
        raise section.error(f"deputy.mass is {mass:g} kg, {allowed}", "mass")
    com = section.vector("com", missing=(0.0, 0.0, 0.0))
    try:
        return Inertia(DEPUTY, mass, com, _moments(section, mass, size))
    except RobotDescriptionError as error:
        raise section.error(str(error), "inertia") from error


def _moments(section: Section, mass: float, size: Floats) -> Floats:
    """Return the six moments given, or those of a uniform box."""
    if "inertia" in section and not isinstance(section.value("inertia"), str):
        return section.vector("inertia")
    if "inertia" in section:
        section.name("inertia", "inertia", [UNIFORM_BOX])
    return box_moments(mass, size)


def _read_twist(section: Section) -> Twist:
    """Return the initial twist; zero where the section says nothing of it."""
    if "twist_in_world" not in section:
        return _AT_REST
    twist = section.section("twist_in_world")
    linear, angular = (twist.vector(part) if part in twist else np.zeros(3) for part in ("linear", "angular"))
    return Twist(np.array(linear), np.array(angular))
