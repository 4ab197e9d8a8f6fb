"""What verification tests share."""

import pinocchio as pin

from sms_handover.model.poses import pose_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose


def links_in_world(robot: RobotModel, q: Array) -> dict[str, Pose]:
    """Return the pose in ``world`` of every link at a configuration (7 + n,)."""
    pin.framesForwardKinematics(robot.pin, robot.data, q)
    frames = enumerate(robot.pin.frames)
    return {f.name: pose_of(robot.data.oMf[i]) for i, f in frames if f.type == pin.FrameType.BODY}
