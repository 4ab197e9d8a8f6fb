"""``sms-handover view``: recorded runs, or a running graph, in 3D in a browser."""

import os
import tempfile
import webbrowser
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.analysis.clearance import run_clearance
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.cli.recorded_runs import named
from sms_handover.cli.text_files import write_text
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.launcher.run_folder import bag_of
from sms_handover.report.animation import recorded_scene
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.scene.page import animation_html
from sms_handover.scene.scene import FRAME_RATE, Scene


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Show runs in 3D. With bags: write one page that plays them and needs no network, and open it;\n"
        "of several runs the first is solid and the others are translucent over it. With --live: show a\n"
        "graph that runs, or a bag that 'bag play' plays back, as it goes; it never holds the graph up."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover view runs/nmpc runs/pid\n"
        "  sms-handover view runs/nmpc -o handover.html\n"
        "  sms-handover view --live --domain-id 42      and in another shell, before or after:\n"
        "  sms-handover run --domain-id 42\n\n"
        "exit codes: 0 shown; 1 the robot cannot be drawn; 2 wrong input"
    )
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the page there")
    parser.add_argument(
        "--no-browser", action="store_true", help="open no browser, only print where the page is"
    )
    parser.add_argument(
        "--frame-rate",
        type=float,
        metavar="HZ",
        help=f"frames per s of simulation time (default: {FRAME_RATE:g})",
    )
    live = parser.add_argument_group("a running graph")
    live.add_argument("--live", action="store_true", help="show what goes on instead of what was recorded")
    live.add_argument(
        "--port", type=int, metavar="N", help="port of the page (default: 8017; 0: any free one)"
    )
    live.add_argument("--domain-id", type=int, metavar="N", help="ROS domain (default: ROS_DOMAIN_ID)")


def needs_ros(options: Namespace) -> bool:
    """Return whether a running graph is to be shown."""
    return bool(options.live)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if options.live:
        if options.runs or options.output:
            raise ConfigurationError("--live shows a running graph: give no RUN and no --output with it")
        return _follow(options)
    if options.port is not None or options.domain_id is not None:
        raise ConfigurationError("--port and --domain-id are for a running graph: give --live with them")
    if not options.runs:
        raise ConfigurationError("nothing to show: give the output folder of a run, or --live")
    page = animation_html(
        _scenes(options), title=f"Handover: {', '.join(p.resolve().name for p in options.runs)}"
    )
    file = options.output or _temporary_file()
    write_text(file, page)
    print(f"{file}: {len(page.encode()) / 1e6:.1f} MB")
    if not options.no_browser and not webbrowser.open(file.resolve().as_uri()):
        print("no browser could be opened; open the file in one")
    return 0


def _follow(options: Namespace) -> int:
    """Run the viewer node in this process until it is interrupted; return the exit code."""
    from sms_handover.cli.node_options import given, run_in_process  # noqa: PLC0415  (bags need no ROS)
    from sms_handover.nodes.viewer import main  # noqa: PLC0415

    values = given(options, {"port": "port", "frame_rate": "frame_rate"})
    if options.no_browser:
        values["browser"] = False
    return run_in_process(main, options, values)


def _scenes(options: Namespace) -> dict[str, Scene]:
    frame_rate = FRAME_RATE if options.frame_rate is None else options.frame_rate
    scenes = {}
    try:
        for name, path in named(map(bag_of, options.runs)).items():
            run = RecordedRun(name, read_run(path), read_info(path))
            clearance = run_clearance(run.data, run.texts) if run.texts else None
            scenes[name] = recorded_scene(run, clearance, frame_rate)
    except BagError as error:
        text = str(error)
        place = "" if str(path) in text else f"{path}: "
        raise ConfigurationError(f"{place}{text}") from error  # exit code 2: it cannot be used
    return scenes


def _temporary_file() -> Path:
    handle, name = tempfile.mkstemp(prefix="handover_", suffix=".html")
    os.close(handle)
    return Path(name)
