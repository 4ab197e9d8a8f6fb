"""Carrying a payload: a robot whose hand holds a body as if it were a part of its last link."""

from copy import copy

import eigenpy
import pinocchio as pin

from sms_handover.model.carried import Carried
from sms_handover.model.robot_model import BASE_NV, RobotModel


def carrying(robot: RobotModel, arm: str, body: pin.Inertia, body_in_tool: pin.SE3) -> RobotModel:
    """Return a robot that carries a body of this inertia, fixed at this pose in the tool of an arm.

    Kinematics, limits and names are those of the bare robot. The inertia of the last link becomes
    Y_link + X Y X^T, with X the action of the pose of the body in the joint of the link. A robot is bare
    again by going back to the one that it was made from: adding and subtracting does not cancel.
    """
    frame_id = robot.tool_frame_id[arm]
    frame = robot.pin.frames[frame_id]
    loaded = copy(robot)
    loaded.pin = pin.Model(robot.pin)
    loaded.pin.inertias[frame.parentJoint] = robot.pin.inertias[frame.parentJoint] + (
        frame.placement * body_in_tool
    ).act(body)
    loaded.data = loaded.pin.createData()
    loaded.base_solver = eigenpy.LLT(BASE_NV)
    loaded.carried = Carried(robot.pin, frame_id, body_in_tool, body)
    return loaded
