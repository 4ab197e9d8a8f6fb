"""Link tree: the links of the robot as a tree of transforms."""

import pinocchio as pin

from sms_handover.frames import WORLD
from sms_handover.model.poses import pose_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose


class LinkTree:
    """Every link with its parent; the parent of the base is ``world``."""

    def __init__(self, robot: RobotModel) -> None:
        """Find the parent of every link."""
        self._robot = robot
        frames = robot.pin.frames
        links = [index for index, frame in enumerate(frames) if frame.type == pin.FrameType.BODY]
        self._pairs = [(_parent_link(robot.pin, index), index) for index in links]
        self.frames = [
            (WORLD if parent is None else frames[parent].name, frames[index].name)
            for parent, index in self._pairs
        ]

    def poses(self, base_in_world: Pose, joint_position: Array) -> list[Pose]:
        """Return the pose of every link in its parent, in the order of ``frames``."""
        robot = self._robot
        q = robot.configuration(base_in_world, joint_position)
        pin.framesForwardKinematics(robot.pin, robot.data, q)
        in_world = robot.data.oMf
        return [
            pose_of(in_world[index] if parent is None else in_world[parent].actInv(in_world[index]))
            for parent, index in self._pairs
        ]


def _parent_link(model: pin.Model, index: int) -> int | None:
    """Return the index of the link that carries a link, None for the base."""
    above = model.frames[index].parentFrame
    while above != 0 and model.frames[above].type != pin.FrameType.BODY:
        above = model.frames[above].parentFrame
    return above or None
