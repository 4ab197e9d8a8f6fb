"""``sms-handover bag export``: tables as CSV or Parquet."""

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.cli.exit_codes import EXIT_OK
from sms_handover.export.export import CSV, FORMATS, export
from sms_handover.export.selection import Selection
from sms_handover.launcher.run_folder import bag_of
from sms_handover.terminal.progress import byte_progress


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write tables into a new folder. A run of sms-handover gives three, joined by stamp: 'ticks' (a row\n"
        "per tick: every joint, effort, command and the base), 'references' (a row per reference period:\n"
        "reference, targets, tools, deputy, momenta, energy, phase) and 'grasp_events'. Any other bag gives\n"
        "a table per topic with its fields flattened. tables.json has the unit of every column. Numbers\n"
        "read back bit for bit."
    )
    parser.epilog = "exit codes: 0 ok; 1 the bag is damaged or holds nothing to export; 2 wrong input"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="new folder")
    parser.add_argument("--format", choices=FORMATS, default=CSV, help="kind of files (default: csv)")
    parser.add_argument("--by-topic", action="store_true", help="a table per topic for a run too")
    group = parser.add_argument_group("selection", "choosing topics gives a table per topic")
    group.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="these topics only")
    group.add_argument("--exclude-topics", nargs="+", default=[], metavar="TOPIC", help="all but these")
    group.add_argument("--regex", default="", metavar="RE", help="topics that match it")
    group.add_argument("--start", type=float, metavar="S", help="from so many s after the first message on")
    group.add_argument("--end", type=float, metavar="S", help="up to so many s after the first message")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    choice = TopicChoice(tuple(options.topics), options.regex, tuple(options.exclude_topics))
    selection = Selection(choice, options.start, options.end)
    with byte_progress("exporting") as progress:
        result = export(
            bag_of(options.bag),
            options.output,
            options.format,
            selection,
            by_topic=options.by_topic,
            progress=progress,
        )
    for topic, reason in result.skipped.items():
        print(f"{topic} is left out: {reason}", file=sys.stderr)
    for name, rows in result.rows.items():
        print(f"{name}: {rows} rows")
    print(f"{len(result.rows)} tables in {result.folder}")
    return EXIT_OK
