"""Definitions of the figures of a comparison, each in one line; ``docs/metrics.md`` has the formulas."""

from collections.abc import Mapping
from types import MappingProxyType

_TOOL = {
    "step_length": "distance of the tool from its goal when the phase begins",
    "band": "deviation within which a tool counts as settled: 2 % of the step, 1 mm or more",
    "overshoot": "how far the tool goes past its goal, along the step",
    "overshoot_ratio": "overshoot over step length",
    "settling_time": "until the deviation stays in the band, from the start; of a phase the slowest tool",
    "largest_error": "largest distance of tool and target in the phase",
    "steady_state_error": "mean distance of tool and target in the last tenth of the phase",
    "final_error": "distance of tool and target at the end of the phase",
    "final_orientation_error": "angle between tool and target at the end of the phase",
    "orientation_step_angle": "angle of the tool from its goal when the phase begins",
    "orientation_band": "angle within which a tool counts as settled: 2 % of the step, 0.2 degrees or more",
    "orientation_overshoot": "how far the tool turns past its goal, about the axis of the step",
    "orientation_overshoot_ratio": "orientation overshoot over step angle",
    "orientation_settling_time": "until the angle to the goal stays in the band, from the start of the phase",
    "largest_orientation_error": "largest angle between tool and target in the phase",
    "steady_state_orientation_error": "mean angle between tool and target in the last tenth of the phase",
}
_TORQUE = {
    "peak_torque": "largest torque of any joint",
    "rms_torque": "root mean square of the norm of the joint torques of an arm",
    "control_effort": "integral of the squared joint torques",
    "saturated_ticks": "commands that the plant had to clip, of the worst joint",
    "ticks_at_peak": "ticks at which the torque is exactly its largest, of the worst joint",
    "net_work": "work of the joint torques; in all the kinetic energy gained + heat - external work",
    "absolute_work": "sum of the magnitudes of the work of each tick: what motors without recuperation need",
    "peak_power": "largest magnitude of the power of any joint over a tick",
}
_BASE = {
    "position_change": "distance of the base between start and end of the phase",
    "attitude_change": "angle of the base between start and end of the phase",
    "mean_speed": "time average of the speed of the base",
    "mean_turn_rate": "time average of the angular speed of the base",
    "drift_begin": "when the slowest run that settles has settled: the window of the drift begins",
    "drift_duration": "length of the window of the drift, to the end of the phase",
    "drift_position_change": "distance of the base between start and end of the window",
    "drift_attitude_change": "angle of the base between start and end of the window",
    "drift_position_rate": "drift of the position: change over duration",
    "drift_attitude_rate": "drift of the attitude: change over duration",
}
_PHYSICS = {
    "largest_linear_momentum": "largest change of linear momentum of robot and deputy, less external impulse",
    "largest_angular_momentum": "largest change of their angular momentum about the centre of mass, likewise",
    "energy_residual": "largest |energy gained - work - external work + heat| over peak_kinetic_energy",
    "peak_kinetic_energy": "largest kinetic energy",
    "external_work": "work of wrenches from outside",
    "energy_lost": "kinetic energy that has become heat, in grips that close and in joints",
    "ik_solves": "inverse kinematics: reference periods with a solve",
    "ik_failures": "inverse kinematics: solves that did not converge",
    "ik_stalled": "inverse kinematics: solves that ended where no step was an improvement",
    "ik_iteration_limit": "inverse kinematics: solves that ended at the limit of iterations",
}
_LIMITS = {
    "largest_rate_share": "largest joint rate as a share of the limit of its joint",
    "time_above_rate_limit": "time in which any joint is faster than its limit",
    "farthest_beyond_position_limit": "how far a joint is past a limit of its position, negative inside",
    "time_beyond_position_limit": "time in which any joint is past a limit of its position",
}
_PLANS = {
    "solves": "solves of the predictive law",
    "failed_solves": "solves that gave no plan",
    "reused_plans": "reference periods in which an older plan was carried on",
    "late_plans": "plans that came after the period for which they were made; real time only",
    "binding_share": "share of the solves in which a row of a constraint binds",
    "solve_median": "median wall time of a solve: linearisation and quadratic program",
    "solve_tail": "99th percentile of the wall time of a solve",
    "solve_max": "largest wall time of a solve",
    "program_median": "median wall time of the quadratic program in a solve",
}
_LOOP = {
    "wall_duration": "wall time from the first recorded state to the last",
    "real_time_factor": "simulated over wall time",
    "largest_lag": "largest lag of the simulation behind the wall clock",
    "period_median": "median wall time between two recorded states",
    "period_tail": "99th percentile of the wall time between two recorded states",
    "period_mean": "mean period of the plant",
    "period_std": "standard deviation of the period of the plant",
    "period_max": "largest period of the plant",
    "late_ticks": "ticks that began more than a tick after their deadline; real time only",
    "held_commands": "ticks integrated with an old command; real time only",
}

CLEARANCE = "clearance: GROUP"  # stands for a figure per group of bodies
DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        **_TOOL,
        **_TORQUE,
        **_BASE,
        **_PHYSICS,
        CLEARANCE: "least signed distance of a group of bodies; below zero they pass through each other",
        **_LIMITS,
        **_PLANS,
        **_LOOP,
    }
)
