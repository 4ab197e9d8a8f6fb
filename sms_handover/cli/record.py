"""``sms-handover record``: record any topics of any graph."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.cli.node_options import add_graph_options, add_topic_options, given, run_in_process
from sms_handover.errors import ConfigurationError
from sms_handover.nodes.topic_recorder import main as run_recorder

_PARAMETERS = {
    "output": "folder",
    "duration": "duration",
    "topics": "topics",
    "regex": "regex",
    "exclude_topics": "exclude_topics",
    "exclude_regex": "exclude_regex",
}


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Record topics to a new MCAP bag that rosbag2, Foxglove and PlotJuggler read. Topics that appear "
        "later are recorded from then on. Interrupt it (Ctrl-C) to end; the bag is then whole. "
        "'sms-handover run' records its own graph by itself, with every message accounted for."
    )
    parser.epilog = (
        "exit codes: 0 the bag is whole; 1 no topic was there, or the disk failed; 2 wrong input, nothing "
        "was recorded"
    )
    parser.add_argument("-a", "--all", action="store_true", help="record every topic")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="new folder (default: rosbag2_<date>-<time>)"
    )
    parser.add_argument("--duration", type=float, metavar="S", help="end by itself after so many s")
    add_topic_options(parser, "record")
    add_graph_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if bool(options.topics or options.regex) == options.all:
        raise ConfigurationError("give either --all or some of --topics and --regex")
    return run_in_process(run_recorder, options, given(options, _PARAMETERS))
