"""Draw the figures of one or more runs and write them to files."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sms_handover.analysis.figure_catalogue import FigureKind, chosen_figures, chosen_formats
from sms_handover.analysis.figures.base import draw_base
from sms_handover.analysis.figures.base_path import draw_base_path
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.joints import draw_joint_error, draw_torque
from sms_handover.analysis.figures.momentum import draw_momentum
from sms_handover.analysis.figures.snapshots import draw_snapshots
from sms_handover.analysis.figures.style import figure_style
from sms_handover.analysis.figures.tool_error import draw_tool_error
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

# what a writer would otherwise add of its own: dates and versions, which differ from day to day
_METADATA: dict[str, dict[str, str | None]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": "sms-handover figures"},
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "sms-handover figures"},
}


def draw_figures(runs: Runs, names: Sequence[str] = ()) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of these kinds, or all, each with a name for its file.

    The runs are laid over each other; of a kind per arm or per run there are several. Raises
    ConfigurationError without a run or with two runs of one name, UnknownNameError for a kind that
    there is not.
    """
    if not runs:
        raise ConfigurationError("there is no run to draw")
    if len({run.name for run in runs}) < len(runs):
        raise ConfigurationError(f"runs need different names, given are {', '.join(r.name for r in runs)}")
    for kind in chosen_figures(names):
        yield from _draw(kind, runs)


def write_figure(figure: Figure, path: Path, dpi: int = PRINT_DPI) -> None:
    """Write a figure to ``path``, in the format that its suffix names; the same figure gives the same bytes.

    Raises UnknownNameError for a suffix that is not one of pdf, png and svg, and ConfigurationError
    if the file cannot be written.
    """
    (suffix,) = chosen_formats([path.suffix.removeprefix(".")])
    try:
        with figure_style():
            figure.savefig(path, dpi=dpi, metadata=_METADATA[suffix])
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error


def _draw(kind: FigureKind, runs: Runs) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of one kind."""
    for name, draw in _parts(kind, runs):
        with figure_style():
            figure = draw()
        FigureCanvasAgg(figure)
        yield name, figure


def _parts(kind: FigureKind, runs: Runs) -> list[tuple[str, Callable[[], Figure]]]:
    """Return what a kind consists of: a name and what draws it, per arm, per run, or one for all."""
    if kind.name in _PER_ARM:
        arms = dict.fromkeys(arm for run in runs for arm in run.data.arms)
        return [(f"{kind.name}_{arm}", partial(_PER_ARM[kind.name], runs, arm)) for arm in arms]
    if kind.name in _PER_RUN:
        shown = [run for run in runs if run.scene is not None]
        return [(f"{kind.name}_{run.name}", partial(_PER_RUN[kind.name], run)) for run in shown]
    return [(kind.name, partial(_OF_ALL[kind.name], runs))]
