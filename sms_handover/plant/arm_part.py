"""Arm part of a state: base and arms, as they are known; behind them are the panels on hinges."""

from dataclasses import dataclass

import numpy as np

from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array, freeze, frozen


@dataclass(frozen=True, eq=False)
class PanelState:
    """The p panels on hinges: ``angle`` (p,) rad, ``rate`` (p,) rad/s.

    Spring and damper give ``torque`` (p,) N m; ``energy`` J is stored in the springs.
    """

    angle: Array
    rate: Array
    torque: Array
    energy: float

    def __post_init__(self) -> None:
        freeze(self, "angle", "rate", "torque")


class ArmPart:
    """Takes base and arms out of the arrays of all that moves; where nothing else does, they are these."""

    def __init__(self, robot: RobotModel) -> None:
        """Take those of a robot with panels locked."""
        self.robot = robot
        self._hinges = np.zeros(len(robot.description.flexible_panels))

    def position(self, q: Array) -> Array:
        """Return q (7 + n,) of q (7 + n + p,)."""
        return q[: BASE_NQ + self.robot.n_joints] if self._hinges.size else q

    def velocity(self, v: Array) -> Array:
        """Return v (6 + n,) of v (6 + n + p,)."""
        return v[: BASE_NV + self.robot.n_joints] if self._hinges.size else v

    def efforts(self, effort: Array) -> Array:
        """Return the efforts (n,) of motors out of (n + p,)."""
        return effort[: self.robot.n_joints] if self._hinges.size else effort

    def padded(self, effort: Array) -> Array:
        """Return efforts (n + p,), of which hinges get none from outside."""
        return frozen(np.concatenate([effort, self._hinges])) if self._hinges.size else effort
