"""Motion of the robot in a reference period, as a function of the joint rates at its end."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import sms_handover as sms


@dataclass(frozen=True, eq=False)
class Motion:
    """The robot at the end of a period of ``h`` s if joints go on at rates w (n,), and what others change.

    No effort changes the momentum, so the twist of the base is H_b^-1 (h_b - H_bm w) [Papadopoulos2021]:
    ``drift`` (6,) plus ``reaction`` (6, n) times the rates, both in its axes at the expected configuration
    ``q`` (7 + n,).
    """

    q: sms.Array
    w: sms.Array
    h: float
    drift: sms.Array
    reaction: sms.Array

    def rates(self, jacobian: sms.Array) -> tuple[sms.Array, sms.Array]:
        """Return J* (r, n) and rest (r,) of what changes by J (r, 6 + n) times v: by J* w + rest."""
        base = jacobian[:, : sms.BASE_NV]
        return jacobian[:, sms.BASE_NV :] + base @ self.reaction, base @ self.drift

    def approaching(
        self, value: sms.Array, jacobian: sms.Array, rest: sms.Array | float, gain: float
    ) -> tuple[sms.Array, sms.Array]:
        """Return A (r, n) and b (r,) so that A w = b is y' = -k y at the end of the period.

        ``value`` (r,) is y there if rates stay as they are; other rates, reached linearly, make it
        y + h J* (w - w_now) / 2. As y is that of the end, A w >= b never lets y fall below zero.
        """
        ahead = 0.5 * gain * self.h
        return (1.0 + ahead) * jacobian, ahead * (jacobian @ self.w) - gain * value - rest


def expected(
    robot: sms.RobotModel, q: sms.Array, v: sms.Array, joints: sms.Array, rates: sms.Array, h: float
) -> Motion:
    """Return the motion of a robot with what it carries from a state q, v, with joints at a setpoint.

    The momentum of the state is kept, whatever it is.
    """
    momentum = sms.conserved_quantities(robot, q, v)
    now = np.concatenate([q[: sms.BASE_NQ], joints])
    after = pin.integrate(robot.pin, now, h * np.concatenate([v[: sms.BASE_NV], rates]))
    drift = sms.drift_of_momentum(robot, after, momentum)
    return Motion(after, rates, h, drift, sms.base_twist_per_joint_rate(robot, after))
