"""``sms-handover figures``: the paper's figures, and some more, from recorded runs."""

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.analysis.figure_catalogue import FIGURES, chosen_figures, chosen_formats
from sms_handover.cli.recorded_runs import read_all
from sms_handover.control.registry import SHIPPED
from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.report.animation import recorded_scene
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.scene.scene import Scene

_SNAPSHOTS = "snapshots"  # the one figure that needs a scene
_FRAME_RATE = 10.0  # [1/s] of the scene that snapshots are taken from
_DEFAULT_FORMATS = "pdf,png"
_DPI = (50, 1200)  # [1/in] least and most


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    listed = [
        f"  {kind.name:<12} {kind.text}" + (f" (paper: figure {kind.paper})" if kind.paper else "")
        for kind in FIGURES
    ]
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Draw figures for print from bags. The runs are laid over each other: the first is solid, the\n"
        "second dashed. docs/figures.md explains each figure."
    )
    parser.epilog = "figures:\n" + "\n".join(listed) + "\n\nFiles that are there already are replaced."
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("figures"),
        metavar="DIR",
        help="where to (default: figures)",
    )
    parser.add_argument(
        "--format",
        default=_DEFAULT_FORMATS,
        metavar="LIST",
        help=f"pdf, png, svg, or several (default: {_DEFAULT_FORMATS})",
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="NAME",
        help="this figure alone, see below; may be given again",
    )
    parser.add_argument("--dpi", type=int, default=300, help="dots per inch of a png (default: 300)")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    formats = chosen_formats([name.strip() for name in options.format.split(",")])
    with_scenes = _SNAPSHOTS in {kind.name for kind in chosen_figures(options.only)}
    if not _DPI[0] <= options.dpi <= _DPI[1]:
        raise ConfigurationError(f"--dpi is {options.dpi} dots per inch, must be {_DPI[0]} to {_DPI[1]}")
    # here, because matplotlib is optional and slow to import: help and wrong input need none of it
    from sms_handover.analysis.figures.draw import draw_figures, write_figure  # noqa: PLC0415
    from sms_handover.analysis.figures.drawn_run import DrawnRun  # noqa: PLC0415

    runs = [
        DrawnRun(_label(run.name), run.data, _scene(run) if with_scenes else None)
        for run in read_all(options.runs)
    ]
    try:
        options.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"{options.output} cannot be made: {error.strerror}") from error
    written = 0
    for name, figure in draw_figures(runs, options.only):
        for suffix in formats:
            path = options.output / f"{name}.{suffix}"
            write_figure(figure, path, options.dpi)
            print(path, flush=True)
            written += 1
    if not written:
        raise ConfigurationError(f"there is nothing to draw of {' '.join(options.only)} in these runs")
    return 0


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
