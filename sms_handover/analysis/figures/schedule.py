"""Mark in a figure what the task was doing: phases and grasps."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.style import FAINT, MUTED
from sms_handover.types import GraspAction, GraspCommand, GraspStatus
from sms_handover.units import ns_to_seconds

_NAMES_AT, _EVENTS_AT = 2.0, 10.5  # [pt] above the axes
_SIZE = 7.0  # [pt]


def mark_boundaries(axes: Axes, runs: Sequence[DrawnRun]) -> None:
    """Draw a line where a phase of the first run begins and where a grasp was tried; show all of the time."""
    ends = [ns_to_seconds(span.end_ns) for run in runs for span in run.phases]
    starts = [ns_to_seconds(span.start_ns) for run in runs for span in run.phases]
    if ends and max(ends) > min(starts):
        axes.set_xlim(min(starts), max(ends))
    for span in runs[0].phases[1:]:
        axes.axvline(ns_to_seconds(span.start_ns), color=FAINT, linewidth=0.6, zorder=1.0)
    for time, _ in _events(runs):
        axes.axvline(time, color=MUTED, linewidth=0.6, zorder=1.1)


def name_phases(axes: Axes, runs: Sequence[DrawnRun]) -> None:
    """Write the phases' names above the axes, and over them what was grasped when."""
    for span in runs[0].phases:
        middle = ns_to_seconds(span.start_ns + span.end_ns) / 2.0
        _write(axes, middle, _NAMES_AT, span.name, style="italic")
    for time, words in _events(runs):
        _write(axes, time, _EVENTS_AT, words)


def _write(axes: Axes, time: float, height: float, text: str, style: str = "normal") -> None:
    """Write a text above the axes, centred at a time."""
    axes.annotate(
        text,
        (time, 1.0),
        (0.0, height),
        xycoords=axes.get_xaxis_transform(),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=_SIZE,
        color=MUTED,
        fontstyle=style,
    )


def _events(runs: Sequence[DrawnRun]) -> list[tuple[float, str]]:
    """Return time in s and words of every grasp event, with the runs in which it failed."""
    keys = dict.fromkeys((event.stamp_ns, event.command) for run in runs for event in run.data.grasp_events)
    found = []
    for stamp_ns, command in sorted(keys, key=lambda key: key[0]):
        failed = [
            run.name
            for run in runs
            for event in run.data.grasp_events
            if (event.stamp_ns, event.command) == (stamp_ns, command)
            and event.status is not GraspStatus.SUCCEEDED
        ]
        note = f" (failed: {', '.join(failed)})" if failed else ""
        found.append((ns_to_seconds(stamp_ns), _in_words(command) + note))
    return found


def in_print(name: str) -> str:
    """Return the name of an arm or phase as it stands in a figure: ``arm_a`` is Arm A."""
    return name.replace("_", " ").title()


def _in_words(command: GraspCommand) -> str:
    """Return a grasp command in a few words."""
    if command.action is GraspAction.TRANSFER:
        return f"{in_print(command.from_arm)} to {in_print(command.arm)}"
    return f"{in_print(command.arm)} {command.action.value}s"
