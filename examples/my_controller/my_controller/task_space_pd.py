"""PD control of the tools of a free-floating robot by the transposed generalised Jacobian.

This file is independent of ROS: the same object runs in one process and in the node.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import sms_handover as sms


@dataclass(frozen=True)
class TaskSpaceGains:
    """Springs and dampers between each tool and its target, and a damper in every joint."""

    stiffness: float = sms.parameter("spring on the tool's position", unit="N/m", minimum=0.0, default=5.0)
    damping: float = sms.parameter("damper on its velocity", unit="N s/m", minimum=0.0, default=7.0)
    angular_stiffness: float = sms.parameter(
        "spring on its orientation", unit="N m/rad", minimum=0.0, default=0.5
    )
    angular_damping: float = sms.parameter(
        "damper on its turn rate", unit="N m s/rad", minimum=0.0, default=0.4
    )
    joint_damping: float = sms.parameter("damper in every joint", unit="N m s/rad", minimum=0.0, default=0.1)


class TaskSpacePd:
    """u = J*^T f - d q_m' with f = -(K e + D x') at every tool, e its error in position and orientation.

    J* is the generalised Jacobian [Umetani1989]: as momentum is conserved, it maps joint rates to the twist
    of a tool, the motion of the base included. Its transpose maps a wrench at the tool to joint efforts, so
    springs and dampers connect each tool to ``world``, whatever the base does.
    """

    def __init__(self, robot: sms.RobotModel, gains: TaskSpaceGains | None = None) -> None:
        self._robot = robot
        self.use(gains or TaskSpaceGains())

    def use(self, gains: TaskSpaceGains) -> None:
        """Switch to other gains."""
        self._stiffness = np.repeat([gains.stiffness, gains.angular_stiffness], 3)
        self._damping = np.repeat([gains.damping, gains.angular_damping], 3)
        self._joint_damping = gains.joint_damping

    def reset(self) -> None:
        """Do nothing: the law has no state but its last targets."""

    def guide(self, guidance: sms.Guidance) -> None:
        """Set the targets of the tools."""
        self._targets = {arm: sms.se3_of(pose) for arm, pose in guidance.tool_in_world.items()}

    def effort(self, stamp_ns: int, q: sms.Array, v: sms.Array) -> sms.Array:
        """Return the joint efforts (n,) N m."""
        rates = v[sms.BASE_NV :]
        tools = self._robot.tools_at(q)
        effort = -self._joint_damping * rates
        for arm, target in self._targets.items():
            jacobian = sms.generalized_jacobian(self._robot, q, arm)  # (6, n), twist in world axes
            tool = sms.se3_of(tools[arm])
            turn = pin.log3(tool.rotation @ target.rotation.T)  # from the target to the tool, in world axes
            error = np.concatenate([tool.translation - target.translation, turn])
            wrench = -(self._stiffness * error + self._damping * (jacobian @ rates))
            effort += jacobian.T @ wrench
        return self._robot.limited(effort)
