"""Cost of a plan: errors of tools and joints, joint rates and accelerations, in the Gauss-Newton form."""

from collections.abc import Sequence

import numpy as np

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.prediction import Prediction
from sms_handover.control.mpc.products import product, times_vector
from sms_handover.control.mpc.sensitivity import Sensitivity
from sms_handover.control.mpc.tool_errors import ToolErrors
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, PreviewedTargets

_DAMPING = 0.01  # [-] of the generalised Jacobian's inverse
_REGULAR = 1e-8  # [-] added to the Hessian's diagonal


class PlanCost:
    """Sum over the horizon, times the interval that an instant begins, and 1 s at its end.

    ell = w_p |e_p|^2 + w_o |e_o|^2 of tools that have a target, w_q |q - q_d|^2 of the joints of other arms,
    w_w |w - w_d|^2 of all joint rates, w_a |a|^2; each over 2. Desired rates w_d are those of joint targets,
    and the least that move the tools as their targets move.
    """

    def __init__(self, robot: RobotModel, gains: MpcGains, horizon: Horizon) -> None:
        self._robot, self._gains, self._horizon = robot, gains, horizon
        self._weights = np.append(horizon.intervals[1:], 1.0)  # of the instants but the first
        one_tool = [gains.tool_position_weight] * 3 + [gains.tool_orientation_weight] * 3
        self._of_tools = np.array(one_tool * len(robot.arms))

    def quadratic(
        self,
        prediction: Prediction,
        accelerations: Array,
        sensitivity: Sensitivity,
        errors: ToolErrors,
        targets: Sequence[PreviewedTargets],
    ) -> tuple[Array, Array]:
        """Return Hessian (N n, N n) and gradient (N n,) by changes of the accelerations (N, n)."""
        gains, horizon, times = self._gains, self._horizon, self._weights
        count, n = horizon.count, self._robot.n_joints
        later = slice(1, count + 1)
        rows = sensitivity.rows(errors.by, later)
        flat, weights = rows.reshape(-1, count * n), (times[:, None] * self._of_tools).ravel()
        weighted = flat * weights[:, None]
        hessian = product(weighted.T, flat)
        gradient = times_vector(weighted.T, errors.errors.ravel())

        alpha, beta = horizon.position_per_acceleration[later], horizon.rate_per_acceleration[later]
        by_joint = np.zeros((n, count, count))
        slope = np.zeros((count, n))
        rate_weights = gains.joint_rate_weight * times
        rate_weights[-1] = gains.terminal_rate_weight
        by_joint += beta.T @ (rate_weights[:, None] * beta)
        slope += beta.T @ (
            rate_weights[:, None] * (prediction.w[later] - _led_rates(prediction, errors, targets))
        )
        held = gains.joint_position_weight * times[:, None] * self._led_by_joints(targets)
        aims = np.array([target.joint_position for target in targets])
        by_joint += np.einsum("kj,kn,ki->nji", alpha, held, alpha)
        slope += alpha.T @ (held * (prediction.q[later] - aims))
        every = np.arange(count)
        by_joint[:, every, every] += gains.joint_acceleration_weight * horizon.intervals + _REGULAR
        slope += gains.joint_acceleration_weight * horizon.intervals[:, None] * accelerations
        blocks = hessian.reshape(count, n, count, n)
        joints = np.arange(n)
        blocks[:, joints, :, joints] += by_joint
        return hessian, gradient + slope.ravel()

    def _led_by_joints(self, targets: Sequence[PreviewedTargets]) -> Array:
        """Return (K, n) with 1 for the joints of arms that no tool leads, 0 for the others."""
        led = np.ones((len(targets), self._robot.n_joints))
        for k, target in enumerate(targets):
            for arm in target.tool_in_world:
                led[k, self._robot.arm_joints[arm]] = 0.0
        return led


def _led_rates(prediction: Prediction, errors: ToolErrors, targets: Sequence[PreviewedTargets]) -> Array:
    """Return the desired joint rates (K, n): J*^T (J* J*^T + d^2)^-1 of the targets' motion [Umetani1989]."""
    rates = np.array([target.joint_velocity for target in targets])
    if not errors.target_rates.any():
        return rates
    jacobian = errors.by.q + errors.by.phi @ prediction.omega_by.w[1:]
    transposed = jacobian.transpose(0, 2, 1)
    damped = jacobian @ transposed + _DAMPING**2 * np.eye(jacobian.shape[1])
    found = transposed @ np.linalg.solve(damped, errors.target_rates[:, :, None])
    return np.asarray(rates + found[:, :, 0])
