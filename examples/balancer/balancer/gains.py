"""Gains of the balancer: what turns of the base count, and the hard bounds."""

from dataclasses import dataclass

import sms_handover as sms


@dataclass(frozen=True)
class Gains:
    """Parameters of the node ``controller`` under this law; a schedule may change them by phase."""

    base_turn_weight: float = sms.parameter(
        "weight of turns of the base against everything else that the arms do; 0: the idle arm is held",
        unit="s^2/rad^2",
        minimum=0.0,
        maximum=1e9,
        default=1e4,
    )
    arm_rate_limit: float = sms.parameter(
        "limit of all joint rates; 0: those of the robot",
        unit="rad/s",
        minimum=0.0,
        default=0.0,
    )
    keep_apart: float = sms.parameter(
        "least distance between two bodies; 1 mm for those of one arm, and for a gripper and the deputy that "
        "it may touch",
        unit="m",
        minimum=0.0,
        maximum=1.0,
        default=0.02,
    )
