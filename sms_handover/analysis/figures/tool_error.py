"""How far each tool is from its target, over time (figures 4 and 5 of the paper)."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import Quantity, add_legend, column_of_panels
from sms_handover.analysis.figures.style import PAGE
from sms_handover.analysis.signals import AXES
from sms_handover.units import DEG_PER_RAD, MM_PER_M

_HEIGHT = 3.6  # [in]


def draw_tool_error(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return the figure of one arm: the components of the position error, and the sizes of both errors."""
    figure = Figure(figsize=(PAGE, _HEIGHT))
    grid = figure.add_gridspec(6, 2)
    left = [figure.add_subplot(grid[2 * row : 2 * row + 2, 0]) for row in range(3)]
    right = [figure.add_subplot(grid[3 * row : 3 * row + 3, 1]) for row in range(2)]
    components = [
        Quantity(f"{arm}/position_error", column, f"${axis}$ error (m)") for column, axis in enumerate(AXES)
    ]
    sizes = [
        Quantity(f"{arm}/position_error", None, "Distance to target (mm)", MM_PER_M, logarithmic=True),
        Quantity(f"{arm}/orientation_error", None, "Angle to target (deg)", DEG_PER_RAD, logarithmic=True),
    ]
    column_of_panels(left, runs, components)
    column_of_panels(right, runs, sizes)
    figure.align_ylabels(left)
    figure.align_ylabels(right)
    add_legend(figure, runs)
    return figure
