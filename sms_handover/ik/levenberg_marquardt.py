"""Levenberg-Marquardt inverse kinematics with the error-dependent damping of Sugihara."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import eigenpy
import numpy as np

from sms_handover.ik.parameters import IkParameters
from sms_handover.ik.residual import PoseResidual, Residual, manipulability
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, IkRequest, IkResult, IkStatus, frozen

_DAMPING_GROWTH = 2.5  # [-] factor on the damping after a step that does not lower the error
_MAX_GROWTHS = 40  # [-] damping then exceeds any curvature, so the step is as good as zero


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of the solver: joint angles (n,) rad, read-only, with the residual there."""

    joint_position: Array
    residual: Residual
    status: IkStatus
    iterations: int


FindJoints = Callable[[IkRequest], Solution]  # for one robot and its parameters


def solve_ik(robot: RobotModel, request: IkRequest, parameters: IkParameters) -> IkResult:
    """Return the result of :func:`find_joints` with measures of its quality."""
    return rated(robot, request, find_joints(robot, request, parameters))


def rated(robot: RobotModel, request: IkRequest, found: Solution) -> IkResult:
    """Return a solution with measures of its quality."""
    q = found.joint_position
    return IkResult(
        joint_position=q,
        status=found.status,
        iterations=found.iterations,
        position_error=found.residual.position_error,
        orientation_error=found.residual.orientation_error,
        limit_margin=float(np.minimum(q - robot.lower, robot.upper - q).min()),
        manipulability=manipulability(robot, q),
        seed_distance=_largest(q - request.seed),
    )


def find_joints(robot: RobotModel, request: IkRequest, parameters: IkParameters) -> Solution:
    """Return the joint angles that bring the tools to their targets, or come nearest from the seed.

    Iterates q <- clamp(q - J^T (J J^T + W_n)^-1 e) with W_n = (E + bias) 1 and E = e^T e / 2
    [Sugihara2011], which equals the step (J^T J + W_n)^-1 J^T e but solves for as many unknowns as there are
    errors. A step that does not lower E is repeated with a larger damping. Joints that the step would
    push through a limit are frozen there for that iteration. The status tells how it ended.
    """
    problem = PoseResidual(robot, request.base_in_world, request.tool_in_world)
    q = frozen(robot.within_limits(request.seed))
    residual = problem.evaluate(q)
    for iteration in range(parameters.max_iterations):
        if _converged(residual, parameters):
            return Solution(q, residual, IkStatus.CONVERGED, iteration)
        q_next, residual_next = _descend(robot, problem, q, residual, parameters.damping_bias)
        if _largest(q_next - q) <= parameters.stall_step:
            return Solution(q, residual, IkStatus.STALLED, iteration)
        q, residual = q_next, residual_next
    status = IkStatus.CONVERGED if _converged(residual, parameters) else IkStatus.ITERATION_LIMIT
    return Solution(q, residual, status, parameters.max_iterations)


def _converged(residual: Residual, parameters: IkParameters) -> bool:
    """Whether both errors are below their tolerances, and are numbers."""
    return (
        residual.energy < inf
        and residual.position_error <= parameters.position_tolerance
        and residual.orientation_error <= parameters.orientation_tolerance
    )


def _descend(
    robot: RobotModel, problem: PoseResidual, q: Array, residual: Residual, bias: float
) -> tuple[Array, Residual]:
    """Return the next iterate with its residual: the first damped step that lowers the error energy.

    If no step does, that is ``q`` itself.
    """
    jacobian = problem.jacobian(q)
    at_lower, at_upper = q <= robot.lower, q >= robot.upper
    if np.count_nonzero(at_lower) or np.count_nonzero(at_upper):
        gradient = residual.values.dot(jacobian)
        jacobian[:, (at_lower & (gradient > 0)) | (at_upper & (gradient < 0))] = 0.0
    damped = jacobian.dot(jacobian.T)
    diagonal = damped.reshape(-1)[:: len(damped) + 1]
    undamped = diagonal.copy()
    for growth in range(_MAX_GROWTHS):
        damping = residual.energy + bias * _DAMPING_GROWTH**growth
        np.add(undamped, damping, out=diagonal)
        step = eigenpy.LLT(damped).solve(residual.values).dot(jacobian)
        candidate = frozen(robot.within_limits(q - step))
        found = problem.evaluate(candidate)
        if found.energy < residual.energy:
            return candidate, found
    return q, residual


def _largest(step: Array) -> float:
    """Return the largest absolute value in a joint array; for so few, lists are faster than NumPy."""
    return float(max(map(abs, step.tolist())))
