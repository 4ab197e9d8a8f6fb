"""Momentum of robot and payload, which no joint effort changes, and the centre of mass."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class BaseStart:
    """What the base's motion over a horizon depends on besides the joints.

    ``rotation`` (3, 3) is the attitude of the base in ``world`` where the plan begins. Momenta (3,) kg m/s
    and, about the centre of mass, kg m^2/s, and the centre of mass (3,) m are in ``world``.
    """

    rotation: Array
    linear_momentum: Array
    angular_momentum: Array
    centre_of_mass: Array

    def __post_init__(self) -> None:
        freeze(self, "rotation", "linear_momentum", "angular_momentum", "centre_of_mass")


def base_start(robot: RobotModel, q: Array, v: Array) -> BaseStart:
    """Return the attitude of the base at a state, and what is conserved: by the centroidal momentum A_G v."""
    momentum = pin.computeCentroidalMomentum(robot.pin, robot.data, q, v)
    rotation = pin.Quaternion(q[3:BASE_NQ]).normalized().matrix()
    centre = np.array(robot.data.com[0])
    return BaseStart(rotation, np.array(momentum.linear), np.array(momentum.angular), centre)


def base_velocity(robot: RobotModel, base: BaseStart, joints: Array, rates: Array) -> Array:
    """Return the angular velocity (3,) rad/s of the base in its axes at joint angles and rates (n,).

    It is that which completes the angular momentum: I_G omega = R^T L - (A_G of the joints alone) w.
    """
    q = np.concatenate([np.zeros(6), [1.0], joints])
    centroidal = pin.computeCentroidalMap(robot.pin, robot.data, q)
    matrix = np.array(centroidal)
    momentum = np.concatenate(
        [base.rotation.T @ base.linear_momentum, base.rotation.T @ base.angular_momentum]
    )
    twist = np.linalg.solve(matrix[:, :BASE_NV], momentum - matrix[:, BASE_NV:] @ rates)
    return np.asarray(twist[3:])
