"""The links of the robot as a tree of transforms, as viewers want them."""

import pinocchio as pin

from sms_handover.frames import WORLD
from sms_handover.model.poses import pose_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose


def link_transforms(
    robot: RobotModel, base_in_world: Pose, joint_position: Array
) -> list[tuple[str, str, Pose]]:
    """Return (parent, child, child_in_parent) for every link; the base's parent is ``world``."""
    q = robot.configuration(base_in_world, joint_position)
    pin.framesForwardKinematics(robot.pin, robot.data, q)
    placements = robot.data.oMf
    transforms = []
    for index, frame in enumerate(robot.pin.frames):
        if frame.type != pin.FrameType.BODY:
            continue
        parent = _parent_link(robot.pin, index)
        if parent is None:
            transforms.append((WORLD, frame.name, pose_of(placements[index])))
        else:
            relative = placements[parent].actInv(placements[index])
            transforms.append((robot.pin.frames[parent].name, frame.name, pose_of(relative)))
    return transforms


def _parent_link(model: pin.Model, index: int) -> int | None:
    """Return the index of the link that carries a link, None for the base."""
    above = model.frames[index].parentFrame
    while above != 0 and model.frames[above].type != pin.FrameType.BODY:
        above = model.frames[above].parentFrame
    return above or None
