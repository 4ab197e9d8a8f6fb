"""Data of the page for its scripts: plots, phases and events as JSON values."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sms_handover.analysis.phases import phase_spans
from sms_handover.graph.events import Severity
from sms_handover.report.plots import Plot, PlotGroup
from sms_handover.report.styles import RunStyle
from sms_handover.run_data import RunData
from sms_handover.types import Array, GraspStatus
from sms_handover.units import ns_to_seconds

PageData = dict[str, Any]


def page_data(runs: Sequence[RunData], styles: Sequence[RunStyle], groups: Sequence[PlotGroup]) -> PageData:
    """Return the values that the scripts read; texts from bags are data, never markup."""
    first = runs[0]
    names = [style.name for style in styles]
    return {
        "runs": [{"name": style.name, "colour": style.colour, "dash": style.dash} for style in styles],
        "span": _span(runs),
        "phases": [
            {"name": span.name, "begin": ns_to_seconds(span.start_ns), "end": ns_to_seconds(span.end_ns)}
            for span in phase_spans(first)
        ],
        "events": _events(runs, names) + _run_events(runs, names),
        "plots": [_plot(plot) for group in groups for plot in group.plots],
    }


def _plot(plot: Plot) -> PageData:
    return {
        "key": plot.key,
        "unit": plot.unit,
        "series": list(plot.series),
        "magnitude": plot.magnitude,
        "levels": [{"value": level.value, "text": level.text} for level in plot.levels],
        "ceiling": plot.ceiling,
        "lines": [
            {
                "run": line.run,
                "series": line.series,
                "time": packed(line.time),
                "values": packed(line.values),
            }
            for line in plot.lines
        ],
    }


def packed(values: Array) -> str:
    """Return numbers as base64 of little-endian float32, whose seven digits are enough for a screen."""
    return b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def _events(runs: Sequence[RunData], names: Sequence[str]) -> list[PageData]:
    """Return the outcome of each grasp command, once for all runs, naming the runs where they differ."""
    statuses: dict[tuple[int, str], dict[str, GraspStatus]] = {}
    for run, name in zip(runs, names, strict=True):
        for event in run.grasp_events:
            key = (event.stamp_ns, f"{event.command.action.value} by {event.command.arm}")
            statuses.setdefault(key, {})[name] = event.status
    return [
        {
            "time": ns_to_seconds(stamp_ns),
            "text": f"{command}: {_outcome(found)}",
            "succeeded": set(found.values()) == {GraspStatus.SUCCEEDED},
        }
        for (stamp_ns, command), found in sorted(statuses.items(), key=lambda item: item[0])
    ]


def _run_events(runs: Sequence[RunData], names: Sequence[str]) -> list[PageData]:
    """Return the warnings and errors that nodes reported, each with its run if there are several."""
    return [
        {
            "time": ns_to_seconds(event.stamp_ns),
            "text": f"{event.kind}: {event.detail}" + (f" in {name}" if len(runs) > 1 else ""),
            "succeeded": False,
        }
        for run, name in zip(runs, names, strict=True)
        for event in run.run_events
        if event.severity is not Severity.INFO
    ]


def _outcome(statuses: Mapping[str, GraspStatus]) -> str:
    """Return the outcome of a grasp command in every run that issued it."""
    if len(set(statuses.values())) == 1:
        return next(iter(statuses.values())).value
    return ", ".join(f"{status.value} in {name}" for name, status in statuses.items())


def _span(runs: Sequence[RunData]) -> list[float]:
    """Return the first and the last time in s of all runs."""
    times = [stamps[[0, -1]] for run in runs for stamps in (run.tick_ns, run.reference_ns) if len(stamps)]
    if not times:
        return [0.0, 0.0]
    return [ns_to_seconds(int(np.min(times))), ns_to_seconds(int(np.max(times)))]
