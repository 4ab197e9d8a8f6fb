"""A control law of one's own: a critically damped spring per joint."""

from dataclasses import dataclass

import numpy as np

import sms_handover as sms


@dataclass(frozen=True)
class Gains:
    """Parameters of the node ``controller`` under this law; a schedule may change them by phase."""

    frequency: float = sms.parameter("natural frequency w", unit="rad/s", minimum=0.0, default=1.0)


class JointPd:
    """u = -m (w^2 e + 2 w q_m'), with m the inertia of each joint on the free base."""

    def __init__(self, setup: sms.LawSetup[Gains]) -> None:
        """Keep the robot, and the gains of every phase."""
        self._robot, self._gains = setup.robot, setup.gains

    def reset(self) -> None:
        """Do nothing: the law has no state but the latest guidance."""

    def guide(self, guidance: sms.Guidance) -> None:
        """Take the joint reference (n,) rad, and the gains of the phase."""
        self._desired = guidance.reference.position
        self._frequency = self._gains[guidance.phase.index].frequency

    def effort(self, stamp_ns: int, q: sms.Array, v: sms.Array) -> sms.Array:
        """Return the joint efforts (n,) N m."""
        inertia = np.diag(sms.reduced_dynamics(self._robot, q, v).inertia)
        error, rate, w = q[sms.BASE_NQ :] - self._desired, v[sms.BASE_NV :], self._frequency
        return self._robot.limited(-inertia * (w**2 * error + 2.0 * w * rate))


LAW = sms.Law("joint_pd", "a critically damped spring per joint", Gains, JointPd)
