"""Joint stops: a joint that reaches a limit of its position stops there, and the base feels it."""

import numpy as np

from sms_handover.model.impulses import impulse_response, predicted_velocity
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.complementarity import solve_bounded
from sms_handover.types import Array, frozen


class JointStops:
    """Inelastic unilateral constraints at both limits of every joint, in ticks of ``h`` s.

    A stop only pushes, and only against a joint that would move on. With impulses g >= 0 of the joints at a
    stop, s = +1 at an upper and -1 at a lower limit [Stewart1996]:

        v_after = v - H^-1 (0, s g),    s q_m'_after <= 0,    g >= 0,    g (s q_m'_after) = 0.

    The rows of the base are zero, as a stop acts between two links: the base takes up what the joint loses,
    and momentum is conserved. Several joints at once are one complementarity problem, whose matrix has the
    rows and columns of H^-1 of these joints with the signs s.
    """

    def __init__(self, robot: RobotModel, h: float) -> None:
        self._robot, self._h = robot, h

    def reached(self, q: Array) -> Array | None:
        """Return s (n,): +1 at or beyond an upper limit, -1 a lower one, else 0; None if all are 0."""
        joints = q[BASE_NQ:]
        above, below = joints >= self._robot.upper, joints <= self._robot.lower
        if not np.count_nonzero(above | below):
            return None
        return above.astype(np.float64) - below

    def efforts(self, q: Array, v: Array, effort: Array, side: Array) -> Array | None:
        """Return what the stops (n,) N m bear over a tick that begins at them; None if nothing presses.

        That is the impulse for the velocity that the acceleration at the start of the tick leads to, spread
        over the tick: a joint that is pressed against its stop rests there, instead of creeping on.
        """
        free = predicted_velocity(self._robot, q, v, effort, self._h)
        impulses = self._impulses(impulse_response(self._robot, q), free, side)
        return impulses / self._h if np.count_nonzero(impulses) else None

    def impact(self, q: Array, v: Array, side: Array) -> tuple[Array, float]:
        """Return the velocity (6 + n,) after the stops, and the energy in J that they have taken.

        Impulses p (n,) at the joints take -p (q_m' + q_m'_after) / 2.
        """
        response = impulse_response(self._robot, q)
        impulses = self._impulses(response, v, side)
        if not np.count_nonzero(impulses):
            return v, 0.0
        after = v + np.add.reduce(response.T * impulses[:, np.newaxis])
        lost = 0.0
        for part in (impulses * (v + after)[BASE_NV:]).tolist():
            lost -= 0.5 * part
        return frozen(after), lost

    def _impulses(self, response: Array, v: Array, side: Array) -> Array:
        """Return the impulses (n,) N m s of the stops on joints that move at v (6 + n,)."""
        at = np.flatnonzero(side)
        sign = side[at]
        matrix = response[BASE_NV:][np.ix_(at, at)] * np.outer(sign, sign)
        pressing = solve_bounded(matrix, -sign * v[BASE_NV:][at], np.full(at.size, np.inf))
        impulses = np.zeros(side.size)
        impulses[at] = -sign * pressing
        return impulses
