"""The path of the free base in space."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import POINTS, run_handles
from sms_handover.analysis.figures.style import COLUMN, FAINT, MUTED, line_style
from sms_handover.analysis.numbers import complete
from sms_handover.types import Array
from sms_handover.units import MM_PER_M, NS_PER_S

_HEIGHT = 3.2  # [in]
_AXES = (-0.05, -0.04, 0.98, 0.98)  # [-] left, bottom, width and height in the figure
_VIEW = (22.0, -52.0)  # [deg] elevation and azimuth
_MARGIN = 0.05  # [-] of the extent, around the paths
_LEAST = 1e-6  # [mm] extent, where nothing moves
_KEY = "base_displacement"


def draw_base_path(runs: Sequence[DrawnRun]) -> Figure:
    """Return the figure: one line per run, equal scales, a mark where each phase after the first begins."""
    figure = Figure(figsize=(COLUMN, _HEIGHT))
    figure.set_layout_engine("none")  # none fits a box in perspective
    axes: Axes3D = figure.add_axes(_AXES, projection="3d")
    paths = [_known_path(run) for run in runs]
    for place, (run, (time, path)) in enumerate(zip(runs, paths, strict=True)):
        step = max(1, -(-len(path) // POINTS))
        look = line_style(place)
        axes.plot(*path[::step].T, **look, gid=f"{run.name}/{_KEY}")
        starts = np.array([span.start_ns / NS_PER_S for span in run.phases[1:]])
        marked = path[np.searchsorted(time, starts[starts <= time[-1:].max(initial=-np.inf)])]
        axes.plot(*marked.T, "o", color=look["color"], markersize=3.0, markerfacecolor="white")
        axes.plot(*path[-1:].T, "s", color=look["color"], markersize=3.5)
    axes.plot([0.0], [0.0], [0.0], "k+", markersize=6.0)
    floor = _set_limits(axes, [path for _, path in paths if len(path)])
    for _, path in paths:
        axes.plot(path[:, 0], path[:, 1], floor, color=FAINT, linewidth=0.6, zorder=0.0)
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_major_locator(MaxNLocator(nbins=4))
        axis.set_tick_params(pad=-2.0)
        axis.pane.set_facecolor("white")
        axis.set_label_text(f"${name}$ (mm)")
        axis.labelpad = -4.0
    axes.view_init(*_VIEW)
    marks = [
        Line2D([], [], color="k", marker="+", linestyle="", markersize=6.0, label="start"),
        Line2D(
            [], [], color=MUTED, marker="o", linestyle="", markersize=3.0, mfc="white", label="next phase"
        ),
        Line2D([], [], color=MUTED, marker="s", linestyle="", markersize=3.5, label="end"),
    ]
    figure.legend(handles=[*run_handles(runs), *marks], loc="upper center", ncols=3)
    return figure


def _known_path(run: DrawnRun) -> tuple[Array, Array]:
    """Return times (K,) in s and places (K, 3) in mm since the start, those that were recorded."""
    signal = run.signals[_KEY]
    known = complete(signal.values)
    return signal.time[known], MM_PER_M * signal.values[known]


def _set_limits(axes: Axes3D, paths: Sequence[Array]) -> float:
    """Fit the box to the paths, with the same scale along all axes; return how high its floor is."""
    places = np.vstack([np.zeros((1, 3)), *paths])
    low, high = places.min(axis=0), places.max(axis=0)
    margin = _MARGIN * max(float(np.max(high - low)), _LEAST)
    for set_limits, begin, end in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), low - margin, high + margin, strict=True
    ):
        set_limits(begin, end)
    axes.set_box_aspect(high - low + 2.0 * margin, zoom=1.05)
    return float(low[2] - margin)
