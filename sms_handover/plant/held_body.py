"""Held body: where what a hand holds is and how it moves, for wrenches that act on it."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, cross
from sms_handover.types import Array

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class LeverArm:
    """What the account of a wrench on a body depends on at an instant, in ``world`` axes.

    ``origin`` (3,) m of the body; ``lever`` (2, 3) is that less the centre of mass of all, and its rate;
    ``turn`` (2, 3) is the angular velocity of the body, and its rate.
    """

    origin: Array
    lever: Array
    turn: Array


@dataclass(frozen=True, eq=False)
class HeldBody:
    """A body of an inertia that is fixed in a tool, by the frame of that tool in the robot's model."""

    tool_frame_id: int
    body_in_tool: pin.SE3
    inertia: pin.Inertia

    def as_body(self, model: pin.Model, data: pin.Data, q: Array) -> BodyAtInstant:
        """Return the body as it is at a configuration (7 + n,) of the robot."""
        pin.forwardKinematics(model, data, q)
        return body_at(self._placement(model, data), self.inertia)

    def generalized(self, model: pin.Model, data: pin.Data, q: Array, wrench: Wrench) -> Array:
        """Return J^T w (6 + n,), with the Jacobian of the body and a wrench about its origin."""
        jacobian = pin.computeFrameJacobian(model, data, q, self.tool_frame_id, _ALIGNED)
        tool = pin.updateFramePlacement(model, data, self.tool_frame_id)
        lever = tool.rotation @ self.body_in_tool.translation
        torque = wrench.torque + cross(lever, wrench.force)
        result: Array = jacobian.T @ np.concatenate([wrench.force, torque])
        return result

    def lever_arm(
        self, model: pin.Model, data: pin.Data, at: tuple[Array, Array, Array], centre: tuple[Array, Array]
    ) -> LeverArm:
        """Return the lever arm at q, v and v', from a centre of mass (3,) m with its velocity (3,) m/s."""
        pin.forwardKinematics(model, data, *at)
        placement = self._placement(model, data)
        twist = pin.getFrameVelocity(model, data, self.tool_frame_id, _ALIGNED)
        turning = pin.getFrameAcceleration(model, data, self.tool_frame_id, _ALIGNED).angular
        origin = np.array(placement.translation)
        velocity = twist.linear + cross(twist.angular, origin - data.oMf[self.tool_frame_id].translation)
        lever = np.array([origin - centre[0], velocity - centre[1]])
        return LeverArm(origin, lever, np.array([twist.angular, turning]))

    def _placement(self, model: pin.Model, data: pin.Data) -> pin.SE3:
        """Return the pose of the body in ``world``, once forward kinematics are done."""
        return pin.updateFramePlacement(model, data, self.tool_frame_id) * self.body_in_tool


def body_at(placement: pin.SE3, inertia: pin.Inertia) -> BodyAtInstant:
    """Return a body of an inertia in its own axes, at a pose in ``world``."""
    rotation = placement.rotation
    centre = placement.act(inertia.lever)
    turned = rotation @ inertia.inertia @ rotation.T
    return BodyAtInstant(np.array(placement.translation), np.array(rotation), inertia.mass, centre, turned)
