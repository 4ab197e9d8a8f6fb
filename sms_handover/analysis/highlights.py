"""Highlights of a comparison: a few figures, each the worst value over a whole run."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from math import isnan, nan

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.layout import Row, Section, row
from sms_handover.analysis.metrics import RunMetrics
from sms_handover.analysis.numbers import largest
from sms_handover.analysis.tracking import Motion, ToolTracking
from sms_handover.types import GraspEvent, GraspStatus
from sms_handover.units import DEG_PER_RAD, MM_PER_M

_MICRO = 1e6
_NEVER = "never"
_cost = partial(row, smaller_is_better=True)

_OF_TOOLS: tuple[tuple[str, Callable[[ToolTracking], float]], ...] = (
    ("largest overshoot [mm]", lambda tool: tool.overshoot * MM_PER_M),
    ("largest overshoot [% of step]", lambda tool: tool.overshoot_ratio * 100.0),
    ("largest final error [mm]", lambda tool: tool.final_error * MM_PER_M),
    ("largest final angle error [deg]", lambda tool: tool.final_orientation_error * DEG_PER_RAD),
)
_OF_BASE: tuple[tuple[str, Callable[[BaseMotion], float]], ...] = (
    ("fastest base drift in position [um/s]", lambda drift: drift.position_rate * _MICRO),
    ("fastest base drift in attitude [urad/s]", lambda drift: drift.attitude_rate * _MICRO),
)


def highlights(comparison: Comparison) -> Section:
    """Return the worst value of each figure over all phases and arms of every run."""
    runs = list(comparison.runs.values())
    with_tools = [run if _tools(run) else None for run in runs]
    drifts = [comparison.drift[name] for name in comparison.runs]
    return Section(
        "Worst value of the run",
        (
            Row("grasp commands that succeeded", tuple(_succeeded(run) for run in runs)),
            _cost("largest distance at a grasp [mm]", runs, _worst_grasp),
            *(_cost(label, runs, partial(_worst, value=value)) for label, value in _OF_TOOLS),
            _cost("longest settling time [s]", with_tools, _slowest, _NEVER),
            *(_cost(label, drifts, partial(_fastest, rate=rate)) for label, rate in _OF_BASE),
            _cost("peak joint torque [N m]", runs, lambda run: largest(run.torque.peak)),
            _cost("control effort [(N m)^2 s]", runs, lambda run: float(run.torque.effort.sum())),
            row("largest change of linear momentum [kg m/s]", runs, lambda run: run.physics.linear_momentum),
            row("energy residual, largest / max E [-]", runs, lambda run: run.physics.energy),
        ),
    )


def succeeded(events: Iterable[GraspEvent]) -> tuple[int, int]:
    """Return how many grasp commands succeeded, and how many there were."""
    outcomes = [event.status is GraspStatus.SUCCEEDED for event in events]
    return sum(outcomes), len(outcomes)


def _succeeded(run: RunMetrics) -> str:
    count, total = succeeded(run.run.grasp_events)
    return f"{count} of {total}"


def _worst_grasp(run: RunMetrics) -> float:
    """Return the largest distance in mm between tool and grasp frame at any grasp command."""
    return largest([event.position_error for event in run.run.grasp_events]) * MM_PER_M


def _tools(run: RunMetrics) -> list[ToolTracking]:
    return [tool for phase in run.phases for tool in phase.tools.values()]


def _worst(run: RunMetrics, value: Callable[[ToolTracking], float]) -> float:
    return largest([value(tool) for tool in _tools(run)])


def _slowest(run: RunMetrics) -> float:
    """Return the longest settling time in s of any moving tool, NaN if one never settles."""
    times = [tool.settling_time for tool in _tools(run) if tool.motion is not Motion.HOLD]
    return nan if any(map(isnan, times)) else largest(times)


def _fastest(phases: Mapping[str, BaseMotion], rate: Callable[[BaseMotion], float]) -> float:
    return largest([rate(drift) for drift in phases.values()])
