"""Schedule of a run in a figure: phases and grasps."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.style import FAINT, MUTED, PAGE
from sms_handover.types import GraspAction, GraspCommand, GraspStatus
from sms_handover.units import ns_to_seconds

_SIZE = 7.0  # [pt] font size
_LETTER = 3.6  # [pt] average width of a letter
_ROW = 8.5  # [pt] from one row of text above the axes to the next
_GAP = 2.0  # [pt] between the axes and the first row
_POINTS_PER_INCH = 72.0
_AXES_PART = 0.8  # [-] smallest share of the axes in the width of their column, beside numbers and label


def mark_boundaries(axes: Axes, runs: Sequence[DrawnRun]) -> None:
    """Draw a line where a phase of the first run begins and at each grasp; show the whole time span."""
    ends = [ns_to_seconds(span.end_ns) for run in runs for span in run.phases]
    starts = [ns_to_seconds(span.start_ns) for run in runs for span in run.phases]
    if ends and max(ends) > min(starts):
        axes.set_xlim(min(starts), max(ends))
    for span in runs[0].phases[1:]:
        axes.axvline(ns_to_seconds(span.start_ns), color=FAINT, linewidth=0.6, zorder=1.0)
    for time, _ in _events(runs):
        axes.axvline(time, color=MUTED, linewidth=0.6, zorder=1.1)


def name_phases(axes: Axes, runs: Sequence[DrawnRun]) -> None:
    """Write the names of the phases above the axes, and the grasps above the names.

    If a name is longer than its phase, the phases are numbered from 1 instead. A grasp that does not fit
    beside its neighbour moves up a row.
    """
    spans = runs[0].phases
    middles = [ns_to_seconds(span.start_ns + span.end_ns) / 2.0 for span in spans]
    scale = _seconds_per_point(axes)
    fits = all(len(span.name) * _LETTER * scale <= span.duration for span in spans)
    names = [span.name if fits else str(number) for number, span in enumerate(spans, 1)]
    for middle, name in zip(middles, names, strict=True):
        _write(axes, middle, 0, name, style="italic")
    ends: list[float] = []  # [s] of the text in each row
    for time, words in _events(runs):
        half = (len(words) + 1) * _LETTER * scale / 2.0
        row = next((row for row, end in enumerate(ends) if end <= time - half), len(ends))
        ends[row : row + 1] = [time + half]
        _write(axes, time, row + 1, words)


def _seconds_per_point(axes: Axes) -> float:
    """Return the time that one point of the width represents, estimated before the layout."""
    place = axes.get_subplotspec()
    columns = place.get_gridspec().ncols if place else 1
    low, high = axes.get_xlim()
    figure = axes.get_figure(root=True)
    width = (figure.get_figwidth() if figure else PAGE) * _POINTS_PER_INCH / columns
    return float(high - low) / (_AXES_PART * width)


def _write(axes: Axes, time: float, row: int, text: str, style: str = "normal") -> None:
    axes.annotate(
        text,
        (time, 1.0),
        (0.0, _GAP + _ROW * row),
        xycoords=axes.get_xaxis_transform(),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=_SIZE,
        color=MUTED,
        fontstyle=style,
    )


def _events(runs: Sequence[DrawnRun]) -> list[tuple[float, str]]:
    """Return time in s and text of every grasp event, with the runs in which it failed."""
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
    """Return the name of an arm or phase as figures show it: ``arm_a`` is Arm A."""
    return name.replace("_", " ").title()


def _in_words(command: GraspCommand) -> str:
    if command.action is GraspAction.TRANSFER:
        return f"{in_print(command.from_arm)} to {in_print(command.arm)}"
    return f"{in_print(command.arm)} {command.action.value}s"
