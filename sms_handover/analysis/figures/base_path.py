"""Path of the free base in space, as a 3D figure."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import POINTS, run_handles
from sms_handover.analysis.figures.style import COLUMN, FAINT, MUTED, line_style
from sms_handover.analysis.numbers import complete
from sms_handover.types import Array
from sms_handover.units import MM_PER_M, NS_PER_S

_HEIGHT = 3.2  # [in]
_EDGE = 0.01  # [-] of the figure, margin around the box and its labels
_LEGEND_COLUMNS = 3
_LEGEND_ROW = 0.06  # [-] of the figure
_FITTINGS = 3  # iterations, since the labels keep their size while the box is scaled
_VIEW = (22.0, -52.0)  # [deg] elevation and azimuth
_MARGIN = 0.05  # [-] of the extent, around the paths
_LEAST = 1e-6  # [mm] extent, where nothing moves
_KEY = "base_displacement"


def draw_base_path(runs: Sequence[DrawnRun]) -> Figure:
    """Return the path of the base: one line per run, equal scales, a mark where each later phase begins."""
    figure = Figure(figsize=(COLUMN, _HEIGHT))
    figure.set_layout_engine("none")  # no layout engine handles a box in perspective
    axes: Axes3D = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d")
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
    handles = [*run_handles(runs), *marks]
    figure.legend(handles=handles, loc="upper center", ncols=_LEGEND_COLUMNS)
    legend_height = _LEGEND_ROW * -(-len(handles) // _LEGEND_COLUMNS)
    _fit(figure, axes, Bbox([[_EDGE, _EDGE], [1.0 - _EDGE, 1.0 - _EDGE - legend_height]]))
    return figure


def _known_path(run: DrawnRun) -> tuple[Array, Array]:
    """Return times (K,) in s and displacements (K, 3) in mm where they were recorded."""
    signal = run.signals[_KEY]
    known = complete(signal.values)
    return signal.time[known], MM_PER_M * signal.values[known]


def _set_limits(axes: Axes3D, paths: Sequence[Array]) -> float:
    """Fit the box to the paths, with the same scale along all axes; return the height of its floor."""
    places = np.vstack([np.zeros((1, 3)), *paths])
    low, high = places.min(axis=0), places.max(axis=0)
    margin = _MARGIN * max(float(np.max(high - low)), _LEAST)
    for set_limits, begin, end in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), low - margin, high + margin, strict=True
    ):
        set_limits(begin, end)
    axes.set_box_aspect(high - low + 2.0 * margin)
    return float(low[2] - margin)


def _fit(figure: Figure, axes: Axes3D, room: Bbox) -> None:
    """Scale and move the axes so that the box with its labels fills ``room`` in the figure."""
    canvas = FigureCanvasAgg(figure)
    for _ in range(_FITTINGS):
        canvas.draw()  # type: ignore[no-untyped-call]
        labels = [axis.get_tightbbox(canvas.renderer) for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
        drawn = Bbox.union([_extent(axes), *labels]).transformed(figure.transFigure.inverted())
        scale = min(room.width / drawn.width, room.height / drawn.height)
        place = axes.get_position(original=True)
        left = (room.x0 + room.x1) / 2.0 + scale * (place.x0 - (drawn.x0 + drawn.x1) / 2.0)
        bottom = (room.y0 + room.y1) / 2.0 + scale * (place.y0 - (drawn.y0 + drawn.y1) / 2.0)
        axes.set_position((left, bottom, scale * place.width, scale * place.height))


def _extent(axes: Axes3D) -> Bbox:
    """Return the extent of the box on the canvas, in dots."""
    corners = np.array(list(product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())))
    right, up, _ = proj3d.proj_transform(*corners.T, axes.get_proj())
    seen = axes.transData.transform(np.column_stack([right, up]))
    return Bbox([seen.min(axis=0), seen.max(axis=0)])
