"""Drawing the figures of one or more runs, and writing them to files."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sms_handover.analysis.figure_catalogue import FigureKind, chosen_figures, chosen_formats
from sms_handover.analysis.figures.base_path import draw_base_path
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.snapshots import draw_snapshots
from sms_handover.analysis.figures.style import figure_style
from sms_handover.analysis.figures.time_series import (
    draw_base,
    draw_joint_error,
    draw_momentum,
    draw_tool_error,
    draw_torque,
)
from sms_handover.errors import ConfigurationError

PRINT_DPI = 300  # [1/in]

Runs = Sequence[DrawnRun]

_OF_ALL: dict[str, Callable[[Runs], Figure]] = {
    "base": draw_base,
    "momentum": draw_momentum,
    "base_path": draw_base_path,
}
_PER_ARM: dict[str, Callable[[Runs, str], Figure]] = {
    "tool_error": draw_tool_error,
    "joint_error": draw_joint_error,
    "torque": draw_torque,
}
_PER_RUN: dict[str, Callable[[DrawnRun], Figure]] = {"snapshots": draw_snapshots}

# the writers would otherwise add dates and versions, and the same figure would not give the same bytes
_METADATA: dict[str, dict[str, str | None]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": "sms-handover"},
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "sms-handover"},
}


def draw_figures(runs: Runs, names: Sequence[str] = ()) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of these kinds, or all, each with a name for its file.

    The runs are overlaid; a kind may have a figure per arm or per run. Raises ConfigurationError if there
    is no run or two have the same name, UnknownNameError for an unknown kind.
    """
    if not runs:
        raise ConfigurationError("there is no run to draw")
    if len({run.name for run in runs}) < len(runs):
        raise ConfigurationError(
            f"runs must have different names, these are {', '.join(r.name for r in runs)}"
        )
    for kind in chosen_figures(names):
        yield from _draw(kind, runs)


def write_figure(figure: Figure, path: Path, dpi: int = PRINT_DPI) -> None:
    """Write a figure to ``path`` in the format of its suffix; the same figure gives the same bytes.

    Raises UnknownNameError if the suffix is not pdf, png or svg, ConfigurationError if the file cannot be
    written.
    """
    (suffix,) = chosen_formats([path.suffix.removeprefix(".")])
    try:
        with figure_style():
            figure.savefig(path, dpi=dpi, metadata=_METADATA[suffix])
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error


def _draw(kind: FigureKind, runs: Runs) -> Iterator[tuple[str, Figure]]:
    for name, draw in _parts(kind, runs):
        with figure_style():
            figure = draw()
        FigureCanvasAgg(figure)
        yield name, figure


def _parts(kind: FigureKind, runs: Runs) -> list[tuple[str, Callable[[], Figure]]]:
    """Return the name and drawing function of each figure of a kind: per arm, per run, or one for all."""
    if kind.name in _PER_ARM:
        arms = dict.fromkeys(arm for run in runs for arm in run.data.arms)
        return [(f"{kind.name}_{arm}", partial(_PER_ARM[kind.name], runs, arm)) for arm in arms]
    if kind.name in _PER_RUN:
        shown = [run for run in runs if run.scene is not None]
        return [(f"{kind.name}_{run.name}", partial(_PER_RUN[kind.name], run)) for run in shown]
    return [(kind.name, partial(_OF_ALL[kind.name], runs))]
