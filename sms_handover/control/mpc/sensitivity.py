"""Sensitivity of a prediction: how outputs depend on the accelerations of all intervals (condensing)."""

from collections.abc import Sequence

import numpy as np

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.prediction import Derivatives, Prediction, flow_derivatives
from sms_handover.types import Array


class Sensitivity:
    """Turns derivatives by the state at an instant into rows by the N n accelerations up to it.

    Those of the joints are known in advance, dq_k/da_j = alpha_kj and dw_k/da_j = beta_kj for each joint;
    that of the attitude follows the trapezoidal rule by which it is predicted.
    """

    def __init__(self, horizon: Horizon, prediction: Prediction) -> None:
        """Condense the attitude of a prediction."""
        self._alpha, self._beta = horizon.position_per_acceleration, horizon.rate_per_acceleration
        nodes, n = prediction.q.shape
        count = horizon.count
        by, self._size = prediction.omega_by, (count, n)
        spin = (
            by.q[:, :, None] * self._alpha[:, None, :, None] + by.w[:, :, None] * self._beta[:, None, :, None]
        )
        spin = spin.reshape(nodes, 3, count * n)
        self.phi = np.zeros((nodes, 3, count * n))
        flows = [flow_derivatives(*row) for row in zip(prediction.phi, prediction.omega, strict=True)]
        for k in range(count):
            half = 0.5 * horizon.intervals[k]
            (phi_before, omega_before), (phi_after, omega_after) = flows[k], flows[k + 1]
            before = self.phi[k] + half * (
                (phi_before + omega_before @ by.phi[k]) @ self.phi[k] + omega_before @ spin[k]
            )
            implicit = np.eye(3) - half * (phi_after + omega_after @ by.phi[k + 1])
            self.phi[k + 1] = np.linalg.solve(implicit, before + half * omega_after @ spin[k + 1])

    def rows(self, by: Derivatives, nodes: Sequence[int] | slice) -> Array:
        """Return the derivatives (K, r, N n) of r outputs at K instants by all accelerations."""
        alpha, beta = self._alpha[nodes], self._beta[nodes]
        found = by.q[:, :, None] * alpha[:, None, :, None] + by.w[:, :, None] * beta[:, None, :, None]
        if by.a is not None:
            at = np.arange(len(self._alpha))[nodes]
            for row, node in enumerate(at):
                found[row, :, node] += by.a[row]
        flat = found.reshape(*found.shape[:2], -1)
        return flat + by.phi @ self.phi[nodes]
