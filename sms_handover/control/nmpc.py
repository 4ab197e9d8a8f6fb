"""NMPC: closed-form nonlinear model predictive control of the reduced dynamics."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sms_handover.configuration.parameters import parameter
from sms_handover.control.compensation import continued, memory_of, restore_memory
from sms_handover.control.computed_torque import ComputedTorque, TrackingEfforts
from sms_handover.control.controller import JointController
from sms_handover.control.law import JointLaw, Law, LawSetup, LinearFeedback, Need
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array

MAX_CONTROL_ORDER = 3


@dataclass(frozen=True)
class NmpcGains:
    """Prediction horizon and order of the input."""

    rolling_period: float = parameter("nmpc: prediction horizon T_r", unit="s", minimum=1e-3)
    control_order: int = parameter(
        "nmpc: order r of the Taylor expansion of the input", minimum=0, maximum=MAX_CONTROL_ORDER
    )

    @property
    def position_gain(self) -> float:
        """A_1 = (r+1)(r+2)(r+4)(r+5) / (12 T_r^2) in 1/s^2; 10/(3 T_r^2) for r = 0."""
        r = self.control_order
        return (r + 1) * (r + 2) * (r + 4) * (r + 5) / (12.0 * self.rolling_period**2)

    @property
    def velocity_gain(self) -> float:
        """A_2 = (r+1)(r+5) / (2 T_r) in 1/s; 5/(2 T_r) for r = 0."""
        r = self.control_order
        return (r + 1) * (r + 5) / (2.0 * self.rolling_period)


class NmpcLaw(JointLaw[NmpcGains]):
    """u = H*(q_d'' - A_1 e - A_2 e') + c*, the minimiser of (1/2) int_0^T_r e(t+s)^T e(t+s) ds [Chen2003].

    H* and c* are those of the arms on the free base, so e'' + A_2 e' + A_1 e = 0 holds exactly for
    a perfect model and unlimited efforts.
    """

    def __init__(
        self,
        robot: RobotModel,
        gains: NmpcGains,
        computed_torque: Callable[[RobotModel], TrackingEfforts] = ComputedTorque,
    ) -> None:
        """Set up the law; ``computed_torque`` makes the inverse dynamics of a robot."""
        self._robot, self._make = robot, computed_torque
        self._efforts = computed_torque(robot)
        self.use(gains)

    def carry(self, robot: RobotModel) -> None:
        """Go on with the inverse dynamics of a robot that carries something else."""
        self._efforts = continued(self._make(robot), self._efforts)

    @property
    def efforts(self) -> TrackingEfforts:
        """The computed torque of the robot."""
        return self._efforts

    @property
    def memory(self) -> Array:
        """The memory of the computed torque, empty unless something is compensated."""
        return memory_of(self._efforts)

    def restore(self, memory: Array) -> None:
        """Go back to a former :attr:`memory`."""
        restore_memory(self._efforts, memory)

    @property
    def feedback(self) -> Array:
        """The gains A_1 and A_2 of each joint, (2, n)."""
        return self._feedback

    def use(self, gains: NmpcGains) -> None:
        """Switch to other gains."""
        pair = np.array([[gains.position_gain], [gains.velocity_gain]])
        self._feedback = np.repeat(pair, self._robot.n_joints, axis=1)

    def effort(self, q: Array, v: Array, desired: Array, dt: float) -> Array:
        """Return the joint efforts (n,) N m, limited to what the joints can give; ``dt`` is unused."""
        return self._robot.limited(self._efforts(q, v, desired, self._feedback))


def linearised(gains: NmpcGains, inertia: Array) -> LinearFeedback:
    """Return K_e = A_1 H*, K_v = A_2 H*, K_z = 0."""
    return LinearFeedback(
        gains.position_gain * inertia, gains.velocity_gain * inertia, np.zeros_like(inertia)
    )


def _controller(setup: LawSetup[NmpcGains]) -> JointController[NmpcGains]:
    """Return the controller of a setup."""
    law = NmpcLaw(setup.robot, setup.gains[0], setup.computed_torque)
    return JointController(law, setup)


NMPC = Law(
    "nmpc",
    "the paper's closed form, without constraints",
    NmpcGains,
    _controller,
    linearised,
    frozenset({Need.PAYLOAD}),
)
