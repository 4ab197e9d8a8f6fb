"""Summary of a comparison as plain values, for JSON and other tools; SI units, None where not defined."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.joints import JointFigures
from sms_handover.analysis.metrics import PhaseMetrics, RunMetrics
from sms_handover.analysis.tracking import ToolTracking
from sms_handover.graph.events import RunEvent
from sms_handover.types import GraspEvent
from sms_handover.units import ns_to_seconds

Summary = dict[str, Any]

_TIME_SERIES = {"phase", "stamp_ns", "position_error", "orientation_error"}


def summary(comparison: Comparison) -> Summary:
    """Return the figures of a comparison without time series, ready for ``json.dumps``."""
    return {
        "runs": {name: _run(metrics, comparison.drift[name]) for name, metrics in comparison.runs.items()},
        "claims": [_values(claim) for claim in comparison.claims],
    }


def _run(metrics: RunMetrics, drift: Mapping[str, BaseMotion]) -> Summary:
    return {
        "completion": {"complete": metrics.completion.complete, **_values(metrics.completion)},
        "phases": [_phase(item, drift[item.phase.name]) for item in metrics.phases],
        **_common(metrics),
        "loop": _values(metrics.loop) if metrics.loop else None,
        "clearance": _plain(metrics.clearance.groups) if metrics.clearance else None,
        "joint_limits": _values(metrics.limits) if metrics.limits else None,
        "grasp_events": [_event(event) for event in metrics.run.grasp_events],
        "run_events": [_event(event) for event in metrics.run.run_events],
    }


def _phase(metrics: PhaseMetrics, drift: BaseMotion) -> Summary:
    return {
        "name": metrics.phase.name,
        "start": ns_to_seconds(metrics.phase.start_ns),
        "end": ns_to_seconds(metrics.phase.end_ns),
        "settling_time": _plain(metrics.settling_time),
        "tools": {arm: _tool(tool) for arm, tool in metrics.tools.items()},
        "base": _values(metrics.base),
        "base_drift": _values(drift),
        **_common(metrics),
    }


def _common(metrics: RunMetrics | PhaseMetrics) -> Summary:
    """Return the figures that a run and each of its phases have."""
    return {
        "torque": _per_joint(metrics.torque),
        "work": _per_joint(metrics.work),
        "physics": _values(metrics.physics),
        "ik": _values(metrics.ik),
    }


def _tool(tool: ToolTracking) -> Summary:
    return {name: value for name, value in _values(tool).items() if name not in _TIME_SERIES}


def _per_joint(figures: JointFigures) -> Summary:
    columns = {item.name: getattr(figures, item.name) for item in fields(figures)[1:]}
    return {
        joint: {name: _plain(values[place]) for name, values in columns.items()}
        for place, joint in enumerate(figures.joint_names)
    }


def _event(event: GraspEvent | RunEvent) -> Summary:
    figures = _values(event)
    time = ns_to_seconds(figures.pop("stamp_ns"))
    return {"time": time, **figures}


def _values(item: Any) -> Summary:
    return {field.name: _plain(getattr(item, field.name)) for field in fields(item)}


def _plain(value: Any) -> Any:
    """Return a value as JSON has it."""
    if is_dataclass(value):
        return _values(value)
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float | np.floating):
        return float(value) if isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
