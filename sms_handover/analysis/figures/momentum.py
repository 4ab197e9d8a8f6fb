"""What must stay zero because nothing pushes the robot from outside."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import Quantity, add_legend, column_of_panels
from sms_handover.analysis.figures.style import COLUMN

_HEIGHT = 3.6  # [in]
_QUANTITIES = (
    Quantity("linear_momentum", None, "$|P|$ (kg m/s)", logarithmic=True),
    Quantity("angular_momentum", None, "$|L|$ (kg m$^2$/s)", logarithmic=True),
    Quantity("energy_residual", None, r"$|\Delta E - W|$ (J)", logarithmic=True),
)


def draw_momentum(runs: Sequence[DrawnRun]) -> Figure:
    """Return the figure of both momenta and of the energy that no work accounts for."""
    figure = Figure(figsize=(COLUMN, _HEIGHT))
    panels = list(figure.subplots(3, 1))
    column_of_panels(panels, runs, _QUANTITIES)
    figure.align_ylabels(panels)
    add_legend(figure, runs)
    return figure
