"""Metrics of a case: the usual figures of its run by short names, and any other that is asked for."""

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from types import MappingProxyType

from sms_handover.analysis.base_motion import base_motion
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.comparison import Comparison, compare
from sms_handover.analysis.metrics import RunMetrics
from sms_handover.analysis.numbers import largest
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.analysis.records import figures_of, records_of
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.types import GraspAction, GraspStatus
from sms_handover.units import ns_to_seconds

Metrics = dict[str, float | None]

USUAL: Mapping[str, tuple[str, str]] = MappingProxyType(
    {  # unit, and what it is
        "complete": ("-", "1 if the task was done and no bodies passed through each other, else 0"),
        "grasps_missed": ("-", "grasp commands that did not succeed"),
        "grasp_error": ("m", "largest distance of gripper and grasp frame at a grasp command"),
        "grasp_angle": ("rad", "largest angle between them"),
        "grasp_speed": ("m/s", "largest relative speed at one"),
        "clearance": ("m", "least distance of bodies beyond what is allowed; below 0 they collide"),
        "base_turn": ("rad", "angle of the base between start and end of the run"),
        "base_shift": ("m", "distance of the base between start and end of the run"),
        "control_effort": ("(N m)^2 s", "integral of the squared joint torques"),
        "absolute_work": ("J", "sum of the magnitudes of the work of all joints"),
        "peak_torque": ("N m", "largest torque of any joint"),
        "saturated_ticks": ("-", "commands that had to be clipped, of the worst joint"),
        "rate_share": ("-", "largest joint rate as a share of its limit"),
        "time_above_rate_limit": ("s", "time in which any joint is faster than its limit"),
        "time_beyond_position_limit": ("s", "time in which any joint is past a limit of its position"),
        "energy_residual": ("-", "largest difference of kinetic energy and work, over the largest energy"),
        "ik_failures": ("-", "solves of inverse kinematics that did not converge"),
        "end_time": ("s", "simulated time at which the run ended"),
    }
)

SMALLER_IS_WORSE = frozenset({"complete", "clearance"})  # of every other metric the larger


def metrics_of(run: RunData, scenario: Scenario, further: Sequence[str]) -> tuple[Metrics, tuple[str, ...]]:
    """Return metrics of a run, the usual and further ones, None where not defined; and what it lacks."""
    truth, common = scenario.truth, scenario.parameters.common
    texts = TaskTexts(truth.robot.urdf, truth.schedule.text, common.contact_depth)
    comparison = compare({"": run}, texts={"": texts})
    found = _usual(comparison.runs[""])
    if further:
        figures = _figures(comparison)
        found.update({name: figures.get(name) for name in further if name not in found})
    lacking = comparison.runs[""].completion.shortfalls
    return {name: _plain(value) for name, value in found.items()}, lacking


def known_metrics(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of all metrics that runs of a scenario can have."""
    phases = [phase.name for phase in scenario.model.schedule.phases]
    figures = figures_of(phases, scenario.model.robot.arms)
    return (*USUAL, *(_name(*figure) for figure in figures))


def _name(phase: str, arm: str, figure: str) -> str:
    """Return a figure by phase and arm, of which either may be empty."""
    return ".".join(filter(None, (phase, arm, figure)))


def _figures(comparison: Comparison) -> dict[str, float]:
    """Return every figure of a run by its full name."""
    return {_name(one.phase, one.arm, one.figure): one.value for one in records_of(comparison)}


def _usual(metrics: RunMetrics) -> dict[str, float | None]:
    """Return the usual metrics."""
    run = metrics.run
    closing = [one for one in run.grasp_events if one.command.action is not GraspAction.RELEASE]
    missed = sum(one.status is not GraspStatus.SUCCEEDED for one in run.grasp_events)
    every = slice(None)
    whole = PhaseSpan(0, "", int(run.tick_ns[0]), int(run.tick_ns[-1]), every, every, every)
    base, limits = base_motion(run, whole), metrics.limits
    margins = [group.margin for group in metrics.clearance.groups] if metrics.clearance else []
    return {
        "complete": float(metrics.completion.complete),
        "grasps_missed": float(missed),
        "grasp_error": largest([one.position_error for one in closing]),
        "grasp_angle": largest([one.angle_error for one in closing]),
        "grasp_speed": largest([one.relative_speed for one in closing]),
        "clearance": min(margins, default=inf),
        "base_turn": base.attitude_change,
        "base_shift": base.position_change,
        "control_effort": float(metrics.torque.effort.sum()),
        "absolute_work": float(metrics.work.absolute.sum()),
        "peak_torque": largest(metrics.torque.peak),
        "saturated_ticks": largest(metrics.torque.saturated_ticks),
        "rate_share": limits.rate.value if limits else None,
        "time_above_rate_limit": limits.rate.beyond if limits else None,
        "time_beyond_position_limit": limits.position.beyond if limits else None,
        "energy_residual": metrics.physics.energy,
        "ik_failures": float(metrics.ik.failures),
        "end_time": ns_to_seconds(int(run.tick_ns[-1])),
    }


def _plain(value: float | None) -> float | None:
    """Return a finite number as Python's float, None for any other."""
    return float(value) if value is not None and isfinite(value) else None
