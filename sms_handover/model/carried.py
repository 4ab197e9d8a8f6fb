"""Carried body: what a robot holds, where, and the robot without it."""

from dataclasses import dataclass

import pinocchio as pin


@dataclass(frozen=True, eq=False)
class Carried:
    """A body of an inertia in its own axes, fixed in a tool of a robot that is ``bare`` without it."""

    bare: pin.Model
    tool_frame_id: int
    body_in_tool: pin.SE3
    inertia: pin.Inertia
