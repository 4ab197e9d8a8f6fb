"""``sms-handover bag record``: record topics of any graph, with the options of ``ros2 bag record``."""

from argparse import ArgumentParser, Namespace
from dataclasses import fields
from pathlib import Path

from sms_handover.bag.parameters import TopicRecorderParameters
from sms_handover.cli.node_options import (
    add_graph_options,
    add_storage_option,
    add_topic_options,
    given,
    run_in_process,
)
from sms_handover.errors import ConfigurationError
from sms_handover.nodes.topic_recorder import main as run_recorder

_BYTES_PER_MB = 1e6


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.description = (
        "Record topics to a new MCAP bag that rosbag2, Foxglove and PlotJuggler read. Topics that appear "
        "later are recorded from then on. Stop with Ctrl-C; the bag is then complete. "
        "'sms-handover run' records its own graph, with every message accounted for."
    )
    parser.epilog = (
        "exit codes: 0 complete; 1 no topic was found, or the disk failed; 2 wrong input, nothing recorded; "
        "3 a topic could not be recorded"
    )
    parser.add_argument("-a", "--all", "--all-topics", action="store_true", help="record every topic")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        dest="folder",
        metavar="FOLDER",
        help="new folder (default: rosbag2_<date>-<time>)",
    )
    add_storage_option(parser)
    parser.add_argument("--duration", type=float, metavar="S", help="stop after S s")
    parser.add_argument(
        "-b", "--max-bag-size", type=int, dest="split_size", metavar="N", help="start a new file after N byte"
    )
    parser.add_argument(
        "-d",
        "--max-bag-duration",
        type=float,
        dest="split_duration",
        metavar="S",
        help="start a new file after S s",
    )
    add_topic_options(parser, "record")
    add_graph_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if bool(options.topics or options.regex) == options.all:
        raise ConfigurationError("give either --all, or --topics or --regex")
    if options.split_size is not None:
        options.split_size /= _BYTES_PER_MB
    names = [field.name for field in fields(TopicRecorderParameters)]
    return run_in_process(run_recorder, options, given(options, names))
