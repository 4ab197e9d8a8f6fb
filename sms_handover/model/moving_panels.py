"""Moving panels: the robot whose panels swing on their hinges, as the plant has it."""

from copy import copy
from dataclasses import replace
from math import inf

import eigenpy
import numpy as np
import pinocchio as pin

from sms_handover.model.assembly import RobotDescription
from sms_handover.model.panels import FlexiblePanel
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.model.springs import Springs
from sms_handover.types import read_only

_NO_LIMIT = 1e9  # [rad/s] of the rate of a hinge, which nothing limits


def with_moving_panels(robot: RobotModel) -> RobotModel:
    """Return a robot whose p panels with hinges are joints, behind those of the arms in every array.

    The joints of the arms keep their places; the hinges have no motor and no limits. A robot without such
    panels is returned as it is.
    """
    panels = robot.description.flexible_panels
    if not panels:
        return robot
    moving = copy(robot)
    bare = RobotModel(_without_panels(robot.description))
    moving.pin, moving.tool_frame_id = bare.pin, bare.tool_frame_id
    for panel in panels:
        _add(moving.pin, panel)
    armature = np.zeros(moving.pin.nv)
    armature[: robot.pin.nv] = robot.pin.armature
    moving.pin.armature = armature
    moving.data = moving.pin.createData()
    moving.base_solver = eigenpy.LLT(BASE_NV)
    stiffness = [panel.hinge.stiffness for panel in panels]
    moving.springs = Springs(np.array(stiffness), np.array([panel.hinge.damping for panel in panels]))
    moving.joint_names = (*robot.joint_names, *(panel.joint for panel in panels))
    moving.n_joints = len(moving.joint_names)
    free = np.full(len(panels), inf)
    moving.lower = read_only(np.concatenate([robot.lower, -free]))
    moving.upper = read_only(np.concatenate([robot.upper, free]))
    moving.effort_limit = read_only(np.concatenate([robot.effort_limit, 0.0 * stiffness_of(panels)]))
    return moving


def stiffness_of(panels: tuple[FlexiblePanel, ...]) -> np.ndarray:
    """Return the stiffness (p,) N m/rad of the hinges of some panels."""
    return np.array([panel.hinge.stiffness for panel in panels])


def _without_panels(description: RobotDescription) -> RobotDescription:
    """Return a robot without the panels that have hinges."""
    rigid = tuple(panel for panel in description.base.panels if panel.hinge is None)
    return replace(description, base=replace(description.base, panels=rigid))


def _add(model: pin.Model, panel: FlexiblePanel) -> None:
    """Add a panel with its hinge to the base of a model."""
    hinge, base = panel.hinge, 1  # the number of the floating joint
    placement = pin.SE3(np.eye(3), np.array(hinge.xyz))
    joint = pin.JointModelRevoluteUnaligned(np.array(hinge.axis))
    none, free = np.zeros(1), np.array([inf])
    index = model.addJoint(base, joint, placement, panel.joint, none, np.array([_NO_LIMIT]), -free, free)
    inertia = panel.inertia
    body = pin.Inertia(inertia.mass, np.array(inertia.com), inertia.matrix)
    model.appendBodyToJoint(index, body, pin.SE3.Identity())
    model.addJointFrame(index)
    model.addBodyFrame(panel.link, index, pin.SE3.Identity(), -1)
