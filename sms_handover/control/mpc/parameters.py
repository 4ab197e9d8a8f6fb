"""Parameters of the predictive law: its horizon, its weights, the limits it keeps, and its inner loop."""

from dataclasses import dataclass

from sms_handover.configuration.parameters import parameter
from sms_handover.control.mpc.derivatives import LINEARISATIONS


@dataclass(frozen=True)
class MpcGains:
    """Parameters of the predictive law; the values are in ``config/controller.yaml``."""

    plan_horizon: float = parameter("mpc: time that a plan looks ahead", unit="s", minimum=0.05, maximum=20.0)
    plan_intervals: int = parameter(
        "mpc: intervals of the horizon, over each of which the joint accelerations of a plan are constant",
        minimum=2,
        maximum=60,
    )
    plan_first_interval: float = parameter(
        "mpc: the first interval of the horizon; the others grow by a constant factor",
        unit="s",
        minimum=1e-3,
        maximum=1.0,
    )
    tool_position_weight: float = parameter("mpc: weight of tool position errors", unit="1/m^2", minimum=0.0)
    tool_orientation_weight: float = parameter(
        "mpc: weight of tool orientation errors", unit="1/rad^2", minimum=0.0
    )
    joint_position_weight: float = parameter(
        "mpc: weight of errors of joints that are led by joint angles", unit="1/rad^2", minimum=0.0
    )
    joint_rate_weight: float = parameter("mpc: weight of joint rates", unit="s^2/rad^2", minimum=0.0)
    joint_acceleration_weight: float = parameter(
        "mpc: weight of joint accelerations", unit="s^4/rad^2", minimum=1e-6
    )
    terminal_rate_weight: float = parameter(
        "mpc: weight of joint rates at the end of the horizon, times 1 s", unit="s^2/rad^2", minimum=0.0
    )
    effort_share: float = parameter(
        "mpc: share of the joints' effort limits that a plan may use", minimum=0.01, maximum=1.0
    )
    joint_rate_limit: float = parameter(
        "mpc: limit of all joint rates; 0: those of the robot", unit="rad/s", minimum=0.0
    )
    base_rate_limit: float = parameter(
        "mpc: limit of the base's angular velocity about each of its axes; 0: none", unit="rad/s", minimum=0.0
    )
    base_attitude_limit: float = parameter(
        "mpc: limit of the base's rotation from its initial attitude about each axis; 0: none",
        unit="rad",
        minimum=0.0,
        maximum=3.0,
    )
    least_distance: float = parameter(
        "mpc: least distance between two bodies; 1 mm for those of one arm, and for a gripper and the deputy "
        "that it may touch; 0: none",
        unit="m",
        minimum=0.0,
        maximum=1.0,
    )
    distance_pairs: int = parameter(
        "mpc: how many pairs of bodies are kept apart at each instant of a plan: the nearest ones",
        minimum=1,
        maximum=64,
    )
    limit_margin: float = parameter(
        "mpc: share by which a plan stays inside limits of rates, attitude and distances, for what the model "
        "does not know",
        minimum=0.0,
        maximum=0.9,
    )
    plan_position_gain: float = parameter(
        "mpc: feedback of joint position about the plan", unit="1/s^2", minimum=0.0
    )
    plan_velocity_gain: float = parameter(
        "mpc: feedback of joint rate about the plan", unit="1/s", minimum=0.0
    )
    linearisation: str = parameter(
        "mpc: derivatives of the dynamics; pinocchio: its analytic ones; compiled: the same as C code, made "
        "once for this robot: faster, needs CasADi and a C compiler",
        choices=LINEARISATIONS,
    )
    program_iterations: int = parameter(
        "mpc: most iterations of the quadratic program; a solve that needs more gives no plan",
        minimum=1,
        maximum=100_000,
    )
    failed_plans: int = parameter(
        "mpc: solves in a row without a plan, in real time reference periods, after which the arms brake to "
        "rest and planning begins anew",
        minimum=1,
        maximum=10_000,
    )
