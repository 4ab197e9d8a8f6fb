"""Cost of a plan: errors of tools and joints, joint rates and accelerations, in the Gauss-Newton form."""

from collections.abc import Sequence

import numpy as np

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.prediction import Prediction, flow_derivatives
from sms_handover.control.mpc.products import product, times_vector
from sms_handover.control.mpc.sensitivity import Sensitivity
from sms_handover.control.mpc.tool_errors import ROWS, ToolErrors
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array

_DAMPING = 0.01  # [-] of the generalised Jacobian's inverse
_REGULAR = 1e-8  # [-] added to the Hessian's diagonal


class PlanCost:
    """Sum over the horizon, times the interval that an instant begins, and 1 s at its end.

    ell = w_p |e_p|^2 + w_o |e_o|^2 of tools that have a target, w_q |q - q_d|^2 of the joints of other arms,
    w_w |w - w_d|^2 of all joint rates, w_a |a|^2; each over 2. Desired rates w_d are those of joint targets,
    and the least that move the tools as their targets move beside what the momentum moves them.
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
        led = np.array([target.joint_velocity for target in targets])
        if errors.by.q.any():
            led += _led_rates(prediction, errors, self._drift(prediction))
        slope += beta.T @ (rate_weights[:, None] * (prediction.w[later] - led))
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

    def _drift(self, prediction: Prediction) -> Array:
        """Return the velocity (3,) m/s of the centre of mass in ``world``."""
        first, second = prediction.centre_in_world[:2]
        return np.asarray((second - first) / self._horizon.intervals[0])

    def _led_by_joints(self, targets: Sequence[PreviewedTargets]) -> Array:
        """Return (K, n) with 1 for the joints of arms that no tool leads, 0 for the others."""
        led = np.ones((len(targets), self._robot.n_joints))
        for k, target in enumerate(targets):
            for arm in target.tool_in_world:
                led[k, self._robot.arm_joints[arm]] = 0.0
        return led


def _led_rates(prediction: Prediction, errors: ToolErrors, drift: Array) -> Array:
    """Return the rates (K, n) that keep the tools on their targets: J*^T (J* J*^T + d^2)^-1 of what is left.

    ``drift`` (3,) m/s is the velocity of the centre of mass. With the joints at rest the momentum turns the
    base at omega_0 and moves the tools by themselves, so that what is left of the motion of the targets is
    e_d' - e_phi phi'(omega_0) - P/M [Umetani1989].
    """
    later = slice(1, None)
    flows = zip(prediction.phi[later], prediction.omega[later], strict=True)
    by_omega = errors.by.phi @ np.array([flow_derivatives(*row)[1] for row in flows])
    turned = prediction.omega_by.w[later]
    alone = prediction.omega[later] - (turned @ prediction.w[later, :, None])[:, :, 0]  # omega_0
    left = errors.target_rates - (by_omega @ alone[:, :, None])[:, :, 0]
    left.reshape(len(left), -1, ROWS)[:, :, :3] -= drift
    left[~errors.by.q.any(axis=2)] = 0.0  # a tool without a target
    jacobian = errors.by.q + by_omega @ turned
    transposed = jacobian.transpose(0, 2, 1)
    damped = jacobian @ transposed + _DAMPING**2 * np.eye(jacobian.shape[1])
    return np.asarray((transposed @ np.linalg.solve(damped, left[:, :, None]))[:, :, 0])
