"""Levenberg-Marquardt inverse kinematics with the error-dependent damping of Sugihara."""

import numpy as np

from sms_handover.ik.parameters import IkParameters
from sms_handover.ik.residual import PoseResidual, Residual, manipulability
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, IkRequest, IkResult, IkStatus

_DAMPING_GROWTH = 2.5  # [-] factor on the damping after a step that does not lower the error
_MAX_GROWTHS = 40  # [-] damping then exceeds any curvature, so the step is as good as zero


def solve_ik(robot: RobotModel, request: IkRequest, parameters: IkParameters) -> IkResult:
    """Return the joint angles that bring the tools to their targets, or come nearest from the seed.

    Iterates q <- clamp(q - (J^T J + W_n)^-1 J^T e) with W_n = (E + bias) 1 and E = e^T e / 2
    [Sugihara2011]; a step that does not lower E is tried again with a larger damping. Joints that
    the step would push through a limit are frozen at it for that iteration, so the others make up
    for it. Always returns: the status tells how it ended.
    """
    seed = np.clip(request.seed, robot.lower, robot.upper)
    if not request.tool_in_world:
        return _result(robot, request, seed, None, IkStatus.CONVERGED, 0)
    problem = PoseResidual(robot, request.base_in_world, request.tool_in_world)
    q = seed
    residual = problem.evaluate(q)
    for iteration in range(parameters.max_iterations):
        if _converged(residual, parameters):
            return _result(robot, request, q, residual, IkStatus.CONVERGED, iteration)
        q_next = _descend(robot, problem, q, residual, parameters.damping_bias)
        if np.max(np.abs(q_next - q)) <= parameters.stall_step:
            return _result(robot, request, q, residual, IkStatus.STALLED, iteration)
        q = q_next
        residual = problem.evaluate(q)
    status = IkStatus.CONVERGED if _converged(residual, parameters) else IkStatus.ITERATION_LIMIT
    return _result(robot, request, q, residual, status, parameters.max_iterations)


def _converged(residual: Residual, parameters: IkParameters) -> bool:
    """Tell whether both errors are below their tolerances."""
    return (
        residual.position_error <= parameters.position_tolerance
        and residual.orientation_error <= parameters.orientation_tolerance
    )


def _descend(robot: RobotModel, problem: PoseResidual, q: Array, residual: Residual, bias: float) -> Array:
    """Return the next iterate: the first damped step that lowers the error energy, or ``q`` itself."""
    gradient = residual.jacobian.T @ residual.values
    at_limit = ((q <= robot.lower) & (gradient > 0)) | ((q >= robot.upper) & (gradient < 0))
    free = np.flatnonzero(~at_limit)
    jacobian = residual.jacobian[:, free]
    curvature = jacobian.T @ jacobian
    identity = np.eye(free.size)
    for growth in range(_MAX_GROWTHS):
        damping = residual.energy + bias * _DAMPING_GROWTH**growth
        step = np.zeros_like(q)
        step[free] = np.linalg.solve(curvature + damping * identity, gradient[free])
        candidate: Array = np.clip(q - step, robot.lower, robot.upper)
        values = problem.values(candidate)
        if 0.5 * float(values @ values) < residual.energy:
            return candidate
    return q


def _result(
    robot: RobotModel, request: IkRequest, q: Array, residual: Residual | None, status: IkStatus, count: int
) -> IkResult:
    """Return the result with the figures that tell how good the configuration is."""
    return IkResult(
        joint_position=q,
        status=status,
        iterations=count,
        position_error=residual.position_error if residual else 0.0,
        orientation_error=residual.orientation_error if residual else 0.0,
        limit_margin=float(np.min(np.minimum(q - robot.lower, robot.upper - q))),
        manipulability=manipulability(robot, request.base_in_world, q),
        seed_distance=float(np.max(np.abs(q - request.seed))),
    )
