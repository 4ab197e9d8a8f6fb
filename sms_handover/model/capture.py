"""Capture of a body by a hand: what the impulse between the two does to both, and what it costs."""

from dataclasses import dataclass

import eigenpy
import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class Capture:
    """What a hand that closes on a body changes.

    ``velocity`` (6 + n,) is that of the robot afterwards, ``impulse`` (6,) N s and N m s what the body gets,
    about its origin in its own axes, ``energy_lost`` J what becomes heat; never negative.
    """

    velocity: Array
    impulse: Array
    energy_lost: float

    def __post_init__(self) -> None:
        freeze(self, "velocity", "impulse")


def carried_jacobian(robot: RobotModel, q: Array, arm: str, body_in_tool: pin.SE3) -> Array:
    """Return the Jacobian (6, 6 + n) of a body fixed in a tool: its twist in its own axes per v."""
    tool = pin.computeFrameJacobian(
        robot.pin, robot.data, q, robot.tool_frame_id[arm], pin.ReferenceFrame.LOCAL
    )
    jacobian: Array = body_in_tool.toActionMatrixInverse() @ tool
    return jacobian


def capture(
    robot: RobotModel, q: Array, v: Array, jacobian: Array, body: pin.Inertia, twist_body_in_body: Array
) -> Capture:
    """Return what happens when a hand closes rigidly on a body that moves otherwise.

    With H of the bare robot, J the Jacobian (6, 6 + n) of the body in the hand, Y its inertia and
    dV = V_d - J v its twist relative to the hand [Nenchev1999]:

        (H + J^T Y J) (v+ - v) = J^T Y dV,    impulse on the body -L dV,    heat dV^T L dV / 2,
        L^-1 = J H^-1 J^T + Y^-1.

    In this form nothing changes, to the bit, where the body moves with the hand. Momentum of both together is
    conserved, and afterwards the body has the twist J v+.
    """
    relative = twist_body_in_body - jacobian @ v
    own, joint = body.matrix(), pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    together = eigenpy.LLT(joint + jacobian.T @ own @ jacobian)
    change = together.solve(jacobian.T @ (own @ relative))
    mobility = jacobian @ eigenpy.LLT(joint).solve(np.ascontiguousarray(jacobian.T)) + np.linalg.inv(own)
    root = np.linalg.cholesky(0.5 * (mobility + mobility.T))
    scaled = np.linalg.solve(root, relative)
    impulse = -np.linalg.solve(root.T, scaled)
    return Capture(v + change, impulse, 0.5 * float(scaled.dot(scaled)))
