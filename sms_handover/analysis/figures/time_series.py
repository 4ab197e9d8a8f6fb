"""Figures of time series: errors of tools and joints, torques, motion of the base, conserved quantities."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import Quantity, add_legend, column_of_panels
from sms_handover.analysis.figures.style import COLUMN, PAGE
from sms_handover.analysis.signals import AXES
from sms_handover.units import DEG_PER_RAD, MM_PER_M

_ROW_HEIGHT = 0.95  # [in] of a row of panels with one joint each
_REST_HEIGHT = 0.8  # [in] of the legend and the labels at the edges

_CONSERVED = (
    Quantity("linear_momentum_change", None, r"$|\Delta P|$ (kg m/s)", logarithmic=True),
    Quantity("angular_momentum_change", None, r"$|\Delta L|$ (kg m$^2$/s)", logarithmic=True),
    Quantity("energy_residual", None, r"$|\Delta E - W|$ (J)", logarithmic=True),
)


def draw_tool_error(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return one tool's position error by component, and the norms of both errors (figures 4, 5)."""
    position, orientation = f"{arm}/position_error", f"{arm}/orientation_error"
    components = [Quantity(position, column, f"${axis}$ error (m)") for column, axis in enumerate(AXES)]
    magnitudes = [
        Quantity(position, None, "Distance to target (mm)", MM_PER_M, logarithmic=True),
        Quantity(orientation, None, "Angle to target (deg)", DEG_PER_RAD, logarithmic=True),
    ]
    return _draw(runs, (components, magnitudes), rows=6, size=(PAGE, 3.6))  # [in]


def draw_base(runs: Sequence[DrawnRun]) -> Figure:
    """Return displacement and rotation of the base since the start, in ``world`` axes (figure 6)."""
    places = [
        Quantity("base_displacement", column, f"${axis}$ (mm)", MM_PER_M) for column, axis in enumerate(AXES)
    ]
    turns = [
        Quantity("base_rotation", column, rf"$\theta_{axis}$ (deg)", DEG_PER_RAD)
        for column, axis in enumerate(AXES)
    ]
    return _draw(runs, (places, turns), rows=3, size=(PAGE, 3.4))  # [in]


def draw_joint_error(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return e = q - q_d of every joint of an arm, and its norm (figures 7, 8)."""
    return _draw_joints(runs, f"{arm}/joint_error", "e", "deg", DEG_PER_RAD)


def draw_torque(runs: Sequence[DrawnRun], arm: str) -> Figure:
    """Return the torque of every joint of an arm, and its norm (figures 9, 10)."""
    return _draw_joints(runs, f"{arm}/joint_torque", r"\tau", "N m", 1.0)


def draw_momentum(runs: Sequence[DrawnRun]) -> Figure:
    """Return the change of both momenta and the energy that no work or heat accounts for; all stay zero."""
    return _draw(runs, (_CONSERVED,), rows=3, size=(COLUMN, 3.6))  # [in]


def _draw_joints(runs: Sequence[DrawnRun], key: str, symbol: str, unit: str, scale: float) -> Figure:
    """Return two columns of panels, one per joint and the last for the norm."""
    count = max((len(run.signals[key].labels) for run in runs if key in run.signals), default=0)
    quantities = [
        Quantity(key, column, f"${symbol}_{{{column + 1}}}$ ({unit})", scale) for column in range(count)
    ]
    quantities.append(Quantity(key, None, f"$|{symbol}|$ ({unit})", scale, logarithmic=True))
    rows = -(-len(quantities) // 2)
    size = (PAGE, rows * _ROW_HEIGHT + _REST_HEIGHT)  # [in]
    return _draw(runs, (quantities[:rows], quantities[rows:]), rows, size)


def _draw(
    runs: Sequence[DrawnRun], columns: Sequence[Sequence[Quantity]], rows: int, size: tuple[float, float]
) -> Figure:
    """Return a figure of ``size`` (in) with columns of panels, in a grid of so many rows."""
    figure = Figure(figsize=size)
    grid = figure.add_gridspec(rows, len(columns))
    for column, quantities in enumerate(filter(None, columns)):
        span = rows // len(quantities)
        panels = [
            figure.add_subplot(grid[span * row : span * (row + 1), column]) for row in range(len(quantities))
        ]
        column_of_panels(panels, runs, quantities)
        figure.align_ylabels(panels)
    add_legend(figure, runs)
    return figure
