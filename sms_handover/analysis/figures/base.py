"""Position and attitude of the free base over time (figure 6 of the paper)."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import Quantity, add_legend, column_of_panels
from sms_handover.analysis.figures.style import PAGE
from sms_handover.analysis.signals import AXES
from sms_handover.units import DEG_PER_RAD, MM_PER_M

_HEIGHT = 3.4  # [in]


def draw_base(runs: Sequence[DrawnRun]) -> Figure:
    """Return the figure of displacement and rotation since the start, in ``world`` axes."""
    figure = Figure(figsize=(PAGE, _HEIGHT))
    panels = figure.subplots(3, 2)
    places = [
        Quantity("base_displacement", column, f"${axis}$ (mm)", MM_PER_M) for column, axis in enumerate(AXES)
    ]
    turns = [
        Quantity("base_rotation", column, rf"$\theta_{axis}$ (deg)", DEG_PER_RAD)
        for column, axis in enumerate(AXES)
    ]
    for column, quantities in enumerate((places, turns)):
        column_of_panels(panels[:, column], runs, quantities)
        figure.align_ylabels(panels[:, column])
    add_legend(figure, runs)
    return figure
