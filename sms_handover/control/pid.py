"""PID: proportional-integral-derivative control of every joint, with anti-windup."""

from dataclasses import dataclass

import numpy as np

from sms_handover.configuration.parameters import parameter
from sms_handover.control.base import ControlLaw, LinearFeedback
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, BASE_NV, Array


@dataclass(frozen=True)
class PidGains:
    """The same three gains for every joint, as in the paper."""

    proportional: float = parameter("proportional gain K_P", unit="N m/rad", minimum=0.0)
    integral: float = parameter("integral gain K_I", unit="N m/(rad s)", minimum=0.0)
    derivative: float = parameter("derivative gain K_D", unit="N m s/rad", minimum=0.0)


class PidLaw(ControlLaw[PidGains]):
    """u = -(K_P e + K_I z + K_D e') with z the integral of e = q - q_d.

    The integral is a forward sum, z_k+1 = z_k + e_k dt. Anti-windup is conditional integration
    [Astrom1995]: a joint whose effort is at its limit integrates only errors that lead it away from it.
    """

    def __init__(self, robot: RobotModel, gains: PidGains) -> None:
        self._robot = robot
        self._gains = gains
        self.reset()

    def reset(self) -> None:
        """Clear the integral."""
        self._integral = np.zeros(self._robot.n_joints)  # [rad s]

    def use(self, gains: PidGains) -> None:
        """Switch to other gains; the integral effort K_I z does not jump."""
        if gains.integral > 0:
            self._integral *= self._gains.integral / gains.integral
        self._gains = gains

    def effort(self, q: Array, v: Array, desired: Array, dt: float) -> Array:
        """Return the joint efforts (n,) N m, limited to what the joints can give."""
        gains = self._gains
        position, velocity, _ = desired
        error = q[BASE_NQ:] - position
        error_rate = v[BASE_NV:] - velocity
        wanted = -(
            gains.proportional * error + gains.integral * self._integral + gains.derivative * error_rate
        )
        effort = self._robot.limited(wanted)
        winds_up = (wanted != effort) & (np.sign(wanted) == -np.sign(error))
        self._integral += np.where(winds_up, 0.0, error * dt)
        return effort

    def linearised(self, inertia: Array) -> LinearFeedback:
        """Return the three gains as diagonal matrices."""
        identity = np.eye(inertia.shape[0])
        gains = self._gains
        return LinearFeedback(
            gains.proportional * identity, gains.derivative * identity, gains.integral * identity
        )
