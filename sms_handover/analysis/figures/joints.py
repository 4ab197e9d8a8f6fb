"""One panel per joint of an arm: errors (figures 7 and 8 of the paper) and torques (9 and 10)."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import Quantity, add_legend, column_of_panels
from sms_handover.analysis.figures.style import PAGE
from sms_handover.units import DEG_PER_RAD

_ROW_HEIGHT = 0.95  # [in] of a row of panels
_REST_HEIGHT = 0.8  # [in] of the legend and the words at the edges


def draw_joint_error(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return the figure of e = q - q_d of every joint of an arm."""
    return _draw(runs, f"{arm}/joint_error", "e", "deg", DEG_PER_RAD)


def draw_torque(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return the figure of the torque of every joint of an arm."""
    return _draw(runs, f"{arm}/joint_torque", r"\tau", "N m", 1.0)


def _draw(runs: Sequence[DrawnRun], key: str, symbol: str, unit: str, scale: float) -> Figure:
    """Return a figure with two columns of panels, the first joints on the left, then their length."""
    count = max((len(run.signals[key].labels) for run in runs if key in run.signals), default=0)
    quantities = [
        Quantity(key, column, f"${symbol}_{{{column + 1}}}$ ({unit})", scale) for column in range(count)
    ]
    quantities.append(Quantity(key, None, f"$|{symbol}|$ ({unit})", scale, logarithmic=True))
    rows = -(-len(quantities) // 2)
    figure = Figure(figsize=(PAGE, rows * _ROW_HEIGHT + _REST_HEIGHT))
    grid = figure.add_gridspec(rows, 2)
    for column, shown in enumerate((quantities[:rows], quantities[rows:])):
        panels: list[Axes] = [figure.add_subplot(grid[row, column]) for row in range(len(shown))]
        if panels:
            column_of_panels(panels, runs, shown)
            figure.align_ylabels(panels)
    add_legend(figure, runs)
    return figure
