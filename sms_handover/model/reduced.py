"""Reduced dynamics and kinematics: the reaction of the unactuated base is eliminated."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.conserved import ConservedQuantities
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, Pose, Twist


@dataclass(frozen=True, eq=False)
class ReducedDynamics:
    """H* (n, n) kg m^2 and c* (n,) N m of H* q_m'' + c* = u."""

    inertia: Array
    bias: Array


def reduced_dynamics(robot: RobotModel, q: Array, v: Array) -> ReducedDynamics:
    """Return the joint-space dynamics of the arms on a free base.

    With the equations of motion split in base (b) and arms (m) rows, no wrench on the base and no
    gravity, the base acceleration is -H_b^-1 (H_bm q_m'' + c_b), hence [Papadopoulos2021]

        H* = H_m - H_bm^T H_b^-1 H_bm,    c* = c_m - H_bm^T H_b^-1 c_b.
    """
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    bias = pin.nonLinearEffects(robot.pin, robot.data, q, v)
    coupling = inertia[:BASE_NV, BASE_NV:]
    right = np.column_stack([coupling, bias[:BASE_NV]])
    solved = np.linalg.solve(inertia[:BASE_NV, :BASE_NV], right)
    reaction = coupling.T @ solved
    return ReducedDynamics(
        inertia=inertia[BASE_NV:, BASE_NV:] - reaction[:, :-1],
        bias=bias[BASE_NV:] - reaction[:, -1],
    )


def reduced_inverse_dynamics(robot: RobotModel, q: Array, v: Array, joint_acceleration: Array) -> Array:
    """Return the joint efforts u (n,) N m that give joint accelerations (n,) rad/s^2 on a free base.

    The same as H* q_m'' + c*, but without forming H*: a base that did not accelerate would need the
    wrench f_b = H_bm q_m'' + c_b; it has none, so it accelerates by a_b = -H_b^-1 f_b, and
    u = H_m q_m'' + c_m + H_mb a_b.
    """
    accelerations = np.zeros(v.size)
    accelerations[BASE_NV:] = joint_acceleration
    forces = pin.rnea(robot.pin, robot.data, q, v, accelerations)
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    solver = robot.base_solver.compute(inertia[:BASE_NV, :BASE_NV])
    yielding = solver.solve(forces[:BASE_NV])  # -a_b
    coupled = inertia[:BASE_NV, BASE_NV:] * yielding[:, np.newaxis]  # (6, n), summed row by row
    efforts: Array = forces[BASE_NV:] - np.add.reduce(coupled)
    return efforts


def base_twist_per_joint_rate(robot: RobotModel, q: Array) -> Array:
    """Return -H_b^-1 H_bm (6, n): the base twist in ``base_link`` axes per joint rate at zero momentum."""
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    reaction: Array = -np.linalg.solve(inertia[:BASE_NV, :BASE_NV], inertia[:BASE_NV, BASE_NV:])
    return reaction


def drift_of_base(robot: RobotModel, q: Array, v: Array) -> Array:
    """Return H_b^-1 h_b (6,): the base twist in ``base_link`` axes that is left with joints at rest.

    h_b = H_b v_b + H_bm q_m' is the momentum about the base, so that v_b = H_b^-1 (h_b - H_bm q_m').
    """
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    drift: Array = np.linalg.solve(inertia[:BASE_NV, :BASE_NV], inertia[:BASE_NV] @ v)
    return drift


def drift_of_momentum(robot: RobotModel, q: Array, momentum: ConservedQuantities) -> Array:
    """Return H_b^-1 h_b (6,) in ``base_link`` axes for momenta P, L about the centre of mass c, in ``world``.

    With R and p of the base, h_b = (R^T P, R^T (L + (c - p) x P)).
    """
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    base = pin.XYZQUATToSE3(q[:BASE_NQ])
    centre = pin.centerOfMass(robot.pin, robot.data, q)
    linear = momentum.linear_momentum
    angular = momentum.angular_momentum + np.cross(centre - base.translation, linear)
    about_base = np.concatenate([base.rotation.T @ linear, base.rotation.T @ angular])
    drift: Array = np.linalg.solve(inertia[:BASE_NV, :BASE_NV], about_base)
    return drift


def carried_twist(base_in_world: Pose, twist_base_in_base: Array, point_in_world: Array) -> Twist:
    """Return the twist in ``world`` axes that a base gives to what moves with it at a point (3,) m."""
    turn = se3_of(base_in_world).rotation
    linear, angular = turn @ twist_base_in_base[:3], turn @ twist_base_in_base[3:]
    return Twist(linear + np.cross(angular, point_in_world - base_in_world.position), angular)


def tool_jacobian(robot: RobotModel, q: Array, arm: str) -> Array:
    """Return the Jacobian (6, 6 + n) of a tool: twist of its origin in ``world`` axes per v."""
    jacobian: Array = pin.computeFrameJacobian(
        robot.pin, robot.data, q, robot.tool_frame_id[arm], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    return jacobian


def generalized_jacobian(robot: RobotModel, q: Array, *arms: str) -> Array:
    """Return the generalised Jacobian (6 k, n) of the tools of k arms, one below the other [Umetani1989].

    It maps joint rates to the tools' twists in ``world`` axes with the base's reaction included,
    for zero momentum: J* = J_m - J_b H_b^-1 H_bm.
    """
    reaction = base_twist_per_joint_rate(robot, q)
    jacobians = [tool_jacobian(robot, q, arm) for arm in arms]
    return np.concatenate([own[:, BASE_NV:] + own[:, :BASE_NV] @ reaction for own in jacobians])
