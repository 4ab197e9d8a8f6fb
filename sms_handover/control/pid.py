"""PID: proportional-integral-derivative control of every joint, with anti-windup."""

from dataclasses import dataclass

import numpy as np

from sms_handover.configuration.parameters import parameter
from sms_handover.control.controller import JointController
from sms_handover.control.law import JointLaw, Law, LawSetup, LinearFeedback
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, BASE_NV, Array, read_only


@dataclass(frozen=True)
class PidGains:
    """The same three gains for every joint, as in the paper."""

    proportional: float = parameter("pid: proportional gain K_P", unit="N m/rad", minimum=0.0)
    integral: float = parameter("pid: integral gain K_I", unit="N m/(rad s)", minimum=0.0)
    derivative: float = parameter("pid: derivative gain K_D", unit="N m s/rad", minimum=0.0)


class PidLaw(JointLaw[PidGains]):
    """u = -(K_P e + K_I z + K_D e') with z the integral of e = q - q_d.

    The integral is a forward sum, z_k+1 = z_k + e_k dt. Anti-windup is conditional integration
    [Astrom1995]: a joint whose effort is at its limit integrates only errors that lead it away from it.
    """

    def __init__(self, robot: RobotModel, gains: PidGains) -> None:
        self._robot = robot
        self._gains = gains
        self._integral = np.zeros(robot.n_joints)  # [rad s]

    @property
    def gains(self) -> PidGains:
        """The gains in use."""
        return self._gains

    @property
    def memory(self) -> Array:
        """The integral (n,) rad s."""
        return read_only(self._integral)

    def restore(self, memory: Array) -> None:
        """Set the integral to ``memory`` (n,) rad s, or to zero if it is empty."""
        self._integral = np.array(memory) if memory.size else np.zeros(self._robot.n_joints)

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


def linearised(gains: PidGains, inertia: Array) -> LinearFeedback:
    """Return the three gains as diagonal matrices."""
    one = np.eye(inertia.shape[0])
    return LinearFeedback(gains.proportional * one, gains.derivative * one, gains.integral * one)


def _controller(setup: LawSetup[PidGains]) -> JointController[PidGains]:
    """Return the controller of a setup."""
    return JointController(PidLaw(setup.robot, setup.gains[0]), setup)


PID = Law("pid", "the paper's PID, the same gains for every joint", PidGains, _controller, linearised)
