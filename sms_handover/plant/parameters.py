"""Parameters of the plant."""

from dataclasses import dataclass

from sms_handover.configuration.parameters import parameter
from sms_handover.plant.deputy import GraspTolerance
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.joint_limits import ENFORCE, REPORT


@dataclass(frozen=True)
class PlantParameters:
    """How the plant integrates and when a grasp holds; the numbers are in ``config/plant.yaml``."""

    integrator: str = parameter("commutator-free Runge-Kutta scheme between ticks", choices=tuple(TABLEAUS))
    grasp_position_tolerance: float = parameter(
        "largest distance of the tool to the grasp frame at which a grasp holds", unit="m", minimum=0.0
    )
    grasp_angle_tolerance: float = parameter(
        "largest angle between tool and grasp frame at which a grasp holds", unit="rad", minimum=0.0
    )
    grasp_speed_tolerance: float = parameter(
        "largest speed of the tool relative to the grasp frame at which a grasp holds",
        unit="m/s",
        minimum=0.0,
    )
    grasp_rate_tolerance: float = parameter(
        "largest angular rate of the tool relative to the deputy at which a grasp holds",
        unit="rad/s",
        minimum=0.0,
    )
    joint_limits: str = parameter(
        "report: joints may exceed their limits, and each excess is an event; enforce: motors drive no joint "
        "past the limit of its rate, and joints stop at the limits of their positions",
        choices=(REPORT, ENFORCE),
    )
    rated_speed: float = parameter(
        "enforced limits: share of the rate limit up to which a motor gives its full torque; from there it "
        "falls linearly, to zero at the limit",
        minimum=0.0,
        maximum=0.99,
    )
    command_hold: float = parameter(
        "real time: how long the last command is held while no newer one comes",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
    command_ramp: float = parameter(
        "real time: how long the torques then take to zero", unit="s", minimum=0.0, maximum=3600.0
    )
    answer_timeout: float = parameter(
        "lock step: wall time without an answer after which the run ends as failed; 0: never",
        unit="s",
        minimum=0.0,
        maximum=86400.0,
    )
    resend_after: float = parameter(
        "lock step: wall time without an answer after which a state is published once more",
        unit="s",
        minimum=0.05,
        maximum=3600.0,
    )
    busy_wait: float = parameter(
        "real time: wall time before a deadline in which the processor is kept, so that the tick begins on "
        "time; a sleep ends late by as much as the system is noisy",
        unit="s",
        minimum=0.0,
        maximum=0.01,
    )
    catch_up: float = parameter(
        "real time: lag up to which ticks are made up for; a larger one, as after a suspension, is skipped, "
        "and simulated time stays behind by it",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )

    @property
    def grasp_tolerance(self) -> GraspTolerance:
        """The tolerances of a grasp."""
        return GraspTolerance(
            self.grasp_position_tolerance,
            self.grasp_angle_tolerance,
            self.grasp_speed_tolerance,
            self.grasp_rate_tolerance,
        )
