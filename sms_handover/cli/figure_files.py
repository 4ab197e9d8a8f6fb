"""Figure files: the paper's figures, and some more, drawn for print into a folder."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from sms_handover.analysis.figure_catalogue import FIGURES, chosen_figures, chosen_formats
from sms_handover.control.registry import SHIPPED
from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.report.animation import recorded_scene
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.scene.scene import Scene

_SNAPSHOTS = "snapshots"  # the one figure that needs a scene
_FRAME_RATE = 10.0  # [1/s] of the scene that snapshots are taken from
_DEFAULT_FORMATS = "pdf,png"
_DEFAULT_DPI = 300  # [1/in]
_DPI = (50, 1200)  # [1/in] least and most

LISTED = "\n".join(
    f"  {kind.name:<12} {kind.text}" + (f" (paper: figure {kind.paper})" if kind.paper else "")
    for kind in FIGURES
)


class FigureFiles(NamedTuple):
    """What to draw, where and how; the dots per inch are those of a png."""

    folder: Path
    names: Sequence[str]
    formats: Sequence[str]
    dpi: int


def add_figure_options(parser: ArgumentParser) -> None:
    """Add the options that choose figures."""
    group = parser.add_argument_group("figures for print", "The first run is solid, the second dashed.")
    group.add_argument("--figures", type=Path, metavar="DIR", help="draw figures; replace those in DIR")
    group.add_argument(
        "--format", metavar="LIST", help=f"pdf, png, svg, or several (default: {_DEFAULT_FORMATS})"
    )
    group.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="NAME",
        help="this figure alone, see below; may be given again",
    )
    group.add_argument("--dpi", type=int, help=f"dots per inch of a png (default: {_DEFAULT_DPI})")


def figures_of(options: Namespace) -> FigureFiles | None:
    """Return the figures that the options choose, None if there are to be none; raises ConfigurationError."""
    if options.figures is None:
        if options.format or options.only or options.dpi:
            raise ConfigurationError("--format, --only and --dpi are for figures: give --figures with them")
        return None
    formats = chosen_formats(
        [name.strip() for name in (_DEFAULT_FORMATS if options.format is None else options.format).split(",")]
    )
    chosen_figures(options.only)
    dpi = _DEFAULT_DPI if options.dpi is None else options.dpi
    if not _DPI[0] <= dpi <= _DPI[1]:
        raise ConfigurationError(f"--dpi is {dpi} dots per inch, must be {_DPI[0]} to {_DPI[1]}")
    return FigureFiles(options.figures, options.only, formats, dpi)


def draw(runs: Sequence[RecordedRun], wanted: FigureFiles) -> None:
    """Draw the figures of runs and print the path of each; raises ConfigurationError if there are none."""
    # here, because matplotlib is optional and slow to import: help and wrong input need none of it
    from sms_handover.analysis.figures.draw import draw_figures, write_figure  # noqa: PLC0415
    from sms_handover.analysis.figures.drawn_run import DrawnRun  # noqa: PLC0415

    with_scenes = _SNAPSHOTS in {kind.name for kind in chosen_figures(wanted.names)}
    drawn = [DrawnRun(_label(run.name), run.data, _scene(run) if with_scenes else None) for run in runs]
    try:
        wanted.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"{wanted.folder} cannot be made: {error.strerror}") from error
    written = 0
    for name, figure in draw_figures(drawn, wanted.names):
        for suffix in wanted.formats:
            path = wanted.folder / f"{name}.{suffix}"
            write_figure(figure, path, wanted.dpi)
            print(path, flush=True)
            written += 1
    if not written:
        raise ConfigurationError(f"there is nothing to draw of {' '.join(wanted.names)} in these runs")


def _label(name: str) -> str:
    """Return the name of a run for a legend: NMPC and PID are written as the paper does."""
    return name.upper() if name in SHIPPED else name


def _scene(run: RecordedRun) -> Scene | None:
    """Return the moving scene of a run, None if its bag does not describe all that there is to see."""
    try:
        return recorded_scene(run, None, _FRAME_RATE)
    except SmsHandoverError as error:
        print(f"no snapshots of {run.name}: {error}", file=sys.stderr)
        return None
