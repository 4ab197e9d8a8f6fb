"""Placement of the robot in the world at every instant of a prediction, for outputs that lie in the world."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.control.mpc.prediction import Prediction
from sms_handover.types import BASE_NV, Array


@dataclass(frozen=True, eq=False)
class Placement:
    """A configuration (7 + n,) in ``world``, and how the base moves with the joints and its attitude.

    ``base_per_q`` (6, n) and ``base_per_phi`` (6, 3) give the displacement of the base in its own axes: the
    centre of mass does not move with either, so the base's origin is at p_G - R c.
    """

    q: Array
    base_per_q: Array
    base_per_phi: Array

    def reduced(self, jacobian: Array) -> tuple[Array, Array]:
        """Return the derivatives (r, n) and (r, 3) by q_m and phi of what has a Jacobian (r, 6 + n) by v."""
        base = jacobian[:, :BASE_NV]
        return jacobian[:, BASE_NV:] + base @ self.base_per_q, base @ self.base_per_phi


def placements(prediction: Prediction) -> list[Placement]:
    """Return the placement at every instant of a prediction."""
    found = []
    for k in range(len(prediction.q)):
        rotation, centre = prediction.rotation[k], prediction.centre[k]
        position = prediction.centre_in_world[k] - rotation @ centre
        quaternion = pin.Quaternion(rotation).coeffs()
        turn = pin.Jexp3(prediction.phi[k])
        by_q = np.vstack([-prediction.centre_per_q[k], np.zeros_like(prediction.centre_per_q[k])])
        by_phi = np.vstack([pin.skew(centre) @ turn, turn])
        found.append(Placement(np.concatenate([position, quaternion, prediction.q[k]]), by_q, by_phi))
    return found
