"""Predicted momentum of robot and payload, and where it takes the base while the joints move."""

import numpy as np
import pinocchio as pin

from sms_handover.model.conserved import ConservedQuantities, conserved_quantities, together
from sms_handover.model.known_payload import KnownPayload
from sms_handover.model.poses import se3_of
from sms_handover.model.reduced import base_twist_per_joint_rate, drift_of_momentum
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.types import Array, GraspAction, GraspEvent, Pose

_PATH_STEPS = 64  # [-] midpoint steps along a joint path; their error is far below a grasp tolerance


def base_after(
    robot: RobotModel,
    base_in_world: Pose,
    start: Array,
    end: Array,
    momentum: ConservedQuantities | None = None,
    duration: float = 0.0,
) -> Pose:
    """Return the base pose after a straight joint path from ``start`` to ``end`` (n,).

    Midpoint rule on SE(3); the twist per joint rate depends on the joints only, not on the base pose. With
    a momentum the base drifts besides, by H_b^-1 h_b for ``duration`` s, as if the joints moved evenly.
    """
    stride = (end - start) / _PATH_STEPS
    h = duration / _PATH_STEPS
    pose = base_in_world
    for index in range(_PATH_STEPS):
        joints = start + (index + 0.5) * stride
        q = robot.configuration(base_in_world, joints)
        shift = base_twist_per_joint_rate(robot, q) @ stride
        if momentum is not None:
            first = shift + h * drift_of_momentum(robot, robot.configuration(pose, joints), momentum)
            halfway = robot.integrate_base(pose, first, 0.5)
            shift += h * drift_of_momentum(robot, robot.configuration(halfway, joints), momentum)
        pose = robot.integrate_base(pose, shift, 1.0)
    return pose


class PredictedMomentum:
    """What robot and payload have together once a deputy with mass is held; at first the robot is at rest."""

    def __init__(self, payload: KnownPayload) -> None:
        """Begin with a robot at rest and empty hands."""
        self.payload = payload
        self.total: ConservedQuantities | None = None

    def of_robot(self, base_in_world: Pose, joints: Array) -> ConservedQuantities:
        """Return what the robot with its payload has, with joints (n,) at rest."""
        robot = self.payload.robot
        q, v = robot.configuration(base_in_world, joints), np.zeros(robot.pin.nv)
        if self.total is not None:
            v[:BASE_NV] = drift_of_momentum(robot, q, self.total)
        return conserved_quantities(robot, q, v)

    def handed_over(self, event: GraspEvent, deputy: RigidDeputy, base_in_world: Pose, joints: Array) -> None:
        """Go on after a grasp command that succeeded, with the robot at this pose and these joints (n,).

        A hand takes the momentum of the deputy; one that lets go leaves it what it has as it moves along.
        """
        before = self.of_robot(base_in_world, joints)
        robot, mass = self.payload.robot, self.payload.robot.mass
        if event.command.action is GraspAction.GRASP:
            self.total = together(before, mass, deputy.conserved, deputy.inertia.mass)
            self.payload.grasped(event)
        elif event.command.action is GraspAction.TRANSFER:
            self.total = before
            self.payload.grasped(event)
        else:
            q, drift = robot.configuration(base_in_world, joints), np.zeros(BASE_NV)
            if self.total is not None:
                drift = drift_of_momentum(robot, q, self.total)
            base, body = se3_of(base_in_world), se3_of(deputy.state.deputy_in_world)
            deputy.let_go((body.inverse() * base).act(pin.Motion(drift)).vector)
            self.payload.grasped(event)
            v = np.concatenate([drift, np.zeros(robot.n_joints)])
            self.total = conserved_quantities(self.payload.robot, q, v)
