"""Panels with the lines of all runs, of which most figures consist."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from sms_handover.analysis.decimation import decimate
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.schedule import mark_boundaries, name_phases
from sms_handover.analysis.figures.style import MUTED, line_style
from sms_handover.analysis.numbers import lengths
from sms_handover.analysis.signals import Signal
from sms_handover.types import Array

POINTS = 2000  # largest number in a line: about one per dot of a printed page
TIME = "Time (s)"
_DECADES = 8  # largest number on a logarithmic axis: smaller values are rounding errors


@dataclass(frozen=True)
class Quantity:
    """What a panel shows of the signal ``key``: one column, or the norm of all if ``column`` is None.

    ``scale`` converts SI units into those of ``label``; the axis may be ``logarithmic``.
    """

    key: str
    column: int | None
    label: str
    scale: float = 1.0
    logarithmic: bool = False

    def of(self, run: DrawnRun) -> tuple[Array, Array]:
        """Return times in s and values; both empty if the run has no such signal."""
        signal: Signal | None = run.signals.get(self.key)
        if signal is None or (self.column or 0) >= len(signal.labels):
            return np.empty(0), np.empty(0)
        values = lengths(signal.values) if self.column is None else signal.values[:, self.column]
        return signal.time, self.scale * values


def draw_lines(axes: Axes, runs: Sequence[DrawnRun], quantity: Quantity) -> None:
    """Draw a quantity of every run over time, with the phases; name the runs that did not record it."""
    missing = []
    for place, run in enumerate(runs):
        time, values = quantity.of(run)
        if not np.any(np.isfinite(values)):
            missing.append(run.name)
            continue
        time, values = decimate(time, values, POINTS)
        identity = f"{run.name}/{quantity.key}/{quantity.column}"
        axes.plot(time, values, **line_style(place), zorder=2.0 + 0.01 * place, gid=identity)
    axes.set_ylabel(quantity.label)
    if quantity.logarithmic:
        _make_logarithmic(axes)
    else:
        axes.yaxis.set_major_locator(MaxNLocator(nbins=4, min_n_ticks=3))
        axes.margins(y=0.08)
    mark_boundaries(axes, runs)
    if missing:
        note = "not recorded" if len(missing) == len(runs) else f"not recorded: {', '.join(missing)}"
        axes.text(0.5, 0.5, note, transform=axes.transAxes, ha="center", va="center", color=MUTED)


def column_of_panels(
    column: Sequence[Axes], runs: Sequence[DrawnRun], quantities: Sequence[Quantity]
) -> None:
    """Fill a column of panels: time below the last, phases above the first."""
    for axes, quantity in zip(column, quantities, strict=True):
        draw_lines(axes, runs, quantity)
        axes.tick_params(labelbottom=axes is column[-1])
    name_phases(column[0], runs)
    column[-1].set_xlabel(TIME)


def run_handles(runs: Sequence[DrawnRun]) -> list[Line2D]:
    """Return a legend entry per run."""
    return [Line2D([], [], **line_style(place), label=run.name) for place, run in enumerate(runs)]


def add_legend(figure: Figure, runs: Sequence[DrawnRun]) -> None:
    """Name the runs above all panels."""
    figure.legend(handles=run_handles(runs), loc="outside upper center", ncols=min(len(runs), 4))


def _make_logarithmic(axes: Axes) -> None:
    """Make the vertical axis logarithmic, limited to ``_DECADES`` below the largest value."""
    lines = [np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.lines]
    sizes = np.concatenate([np.empty(0), *lines])
    sizes = sizes[np.isfinite(sizes) & (sizes > 0.0)]
    axes.set_yscale("log")
    if sizes.size:
        top = np.ceil(np.log10(sizes.max()) + 0.1)
        bottom = max(np.floor(np.log10(sizes.min())), top - _DECADES)
        axes.set_ylim(10.0**bottom, 10.0**top)
