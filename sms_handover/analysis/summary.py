"""A comparison of runs as plain values, for JSON and for other tools; SI units, None where not defined."""

from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.claims import Claim
from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.metrics import PhaseMetrics, RunMetrics
from sms_handover.analysis.torque import JointTorque
from sms_handover.analysis.tracking import ToolTracking
from sms_handover.analysis.work import JointWork
from sms_handover.graph.events import RunEvent
from sms_handover.types import GraspEvent
from sms_handover.units import ns_to_seconds

Summary = dict[str, Any]

_TIME_HISTORIES = {"phase", "stamp_ns", "position_error", "orientation_error"}


def summary(comparison: Comparison) -> Summary:
    """Return the figures of a comparison, without time histories, ready for ``json.dumps``."""
    return {
        "runs": {name: _run(metrics, comparison.drift[name]) for name, metrics in comparison.runs.items()},
        "claims": [_claim(claim) for claim in comparison.claims],
    }


def _run(metrics: RunMetrics, drift: Mapping[str, BaseMotion]) -> Summary:
    """Return the figures of one run."""
    return {
        "phases": [_phase(item, drift[item.phase.name]) for item in metrics.phases],
        "torque": _per_joint(metrics.torque),
        "work": _per_joint(metrics.work),
        "physics": _values(metrics.physics),
        "ik": _values(metrics.ik),
        "loop": _values(metrics.loop) if metrics.loop else None,
        "grasp_events": [_event(event) for event in metrics.run.grasp_events],
        "run_events": [_run_event(event) for event in metrics.run.run_events],
    }


def _phase(metrics: PhaseMetrics, drift: BaseMotion) -> Summary:
    """Return the figures of one phase."""
    return {
        "name": metrics.phase.name,
        "start": ns_to_seconds(metrics.phase.start_ns),
        "end": ns_to_seconds(metrics.phase.end_ns),
        "settling_time": _plain(metrics.settling_time),
        "tools": {arm: _tool(tool) for arm, tool in metrics.tools.items()},
        "base": _values(metrics.base),
        "base_drift": _values(drift),
        "torque": _per_joint(metrics.torque),
        "work": _per_joint(metrics.work),
        "physics": _values(metrics.physics),
        "ik": _values(metrics.ik),
    }


def _tool(tool: ToolTracking) -> Summary:
    """Return the figures of one tool."""
    figures = {name: value for name, value in _values(tool).items() if name not in _TIME_HISTORIES}
    return {**figures, "orientation": _values(tool.orientation)}


def _per_joint(figures: JointTorque | JointWork) -> Summary:
    """Return the figures of every joint by its name."""
    columns = {item.name: getattr(figures, item.name) for item in fields(figures)[1:]}
    return {
        joint: {name: _plain(values[place]) for name, values in columns.items()}
        for place, joint in enumerate(figures.joint_names)
    }


def _event(event: GraspEvent) -> Summary:
    """Return one grasp event."""
    return {
        "time": ns_to_seconds(event.stamp_ns),
        "command": _values(event.command),
        "status": event.status.value,
        "position_error": _plain(event.position_error),
        "angle_error": _plain(event.angle_error),
        "relative_speed": _plain(event.relative_speed),
        "detail": event.detail,
    }


def _run_event(event: RunEvent) -> Summary:
    """Return what a node has decided."""
    figures = _values(event)
    return {"time": ns_to_seconds(figures.pop("stamp_ns")), **figures}


def _claim(claim: Claim) -> Summary:
    """Return one claim with its verdict."""
    return {**_values(claim), "findings": [_values(finding) for finding in claim.findings]}


def _values(item: Any) -> Summary:
    """Return the fields of a dataclass as plain values."""
    return {field.name: _plain(getattr(item, field.name)) for field in fields(item)}


def _plain(value: Any) -> Any:
    """Return numbers and enums as JSON knows them."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float | np.floating):
        return float(value) if isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
