"""Shapes of a robot description: solids, each in the frame of its link."""

from dataclasses import dataclass
from typing import Any, Literal

import pinocchio as pin

from sms_handover.errors import RobotDescriptionError
from sms_handover.model.poses import pose_of
from sms_handover.types import Pose


@dataclass(frozen=True, eq=False)
class Shape:
    """One solid: a box with ``size`` its edges (x, y, z) m, or a cylinder along z with (radius, length) m.

    Both are centred on ``pose_in_link``; ``rgba`` has red, green, blue and opacity from 0 to 1.
    """

    link: str
    kind: Literal["box", "cylinder"]
    size: tuple[float, ...]
    pose_in_link: Pose
    rgba: tuple[float, float, float, float]


def read_shapes(model: pin.Model, urdf: str) -> tuple[Shape, ...]:
    """Return the visual shapes of a description; ``model`` is Pinocchio's model of the same text.

    Raises RobotDescriptionError for a shape that is neither a box nor a cylinder.
    """
    try:
        drawn = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f"the shapes of the robot cannot be read: {error}") from error
    return tuple(_shape(model, item) for item in drawn.geometryObjects)


def _shape(model: pin.Model, item: Any) -> Shape:
    """Return a geometry object, which Pinocchio places relative to the parent joint, in its link's frame."""
    frame = model.frames[item.parentFrame]
    pose_in_link = pose_of(frame.placement.actInv(item.placement))
    red, green, blue, opacity = (float(part) for part in item.meshColor)
    rgba = (red, green, blue, opacity)
    solid = item.geometry
    name = type(solid).__name__
    if name == "Box":
        size = tuple(2.0 * float(half) for half in solid.halfSide)
        return Shape(frame.name, "box", size, pose_in_link, rgba)
    if name == "Cylinder":
        size = float(solid.radius), 2.0 * float(solid.halfLength)
        return Shape(frame.name, "cylinder", size, pose_in_link, rgba)
    raise RobotDescriptionError(f"link {frame.name!r} is drawn as a {name}, it must be a box or a cylinder")
