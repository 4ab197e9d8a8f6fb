"""``sms-handover bag export``: export tables as CSV, Parquet or MATLAB files."""

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.cli.exit_codes import EXIT_LOSS, EXIT_OK
from sms_handover.export.export import CSV, FORMATS, export
from sms_handover.export.selection import Selection
from sms_handover.launcher.run_folder import bag_of
from sms_handover.terminal.progress import byte_progress
from sms_handover.terminal.streams import printable


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write tables to a new folder. A run of sms-handover gives 'ticks' (a row per tick: joints, base),\n"
        "'references' (a row per reference period: references, targets, tools, deputy, momenta, energy,\n"
        "phase), 'grasp_events' and 'run_events'. Any other bag gives a table per topic with flattened\n"
        "fields. tables.json has the unit of every column. Numbers read back bit for bit."
    )
    parser.epilog = "exit codes: 0 complete; 1 damaged bag, or nothing to export; 2 wrong input; 3 incomplete"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="new folder")
    parser.add_argument("--format", choices=FORMATS, default=CSV, help="file format (default: csv)")
    parser.add_argument("--by-topic", action="store_true", help="write a table per topic for a run too")
    group = parser.add_argument_group("selection", "selecting topics gives a table per topic")
    group.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="only these topics")
    group.add_argument("--exclude-topics", nargs="+", default=[], metavar="TOPIC", help="not these topics")
    group.add_argument("--regex", default="", metavar="RE", help="topics that match")
    group.add_argument("--start", type=float, metavar="S", help="start S s after the first message")
    group.add_argument("--end", type=float, metavar="S", help="end S s after the first message")


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
    for text in result.missing:
        print(f"not exported: {text}", file=sys.stderr)
    for topic, reason in result.skipped.items():
        count = result.left_out[topic]
        print(f"not exported: {printable(topic)}: {count} messages: {reason}", file=sys.stderr)
    for name, rows in result.rows.items():
        print(f"{name}: {rows} rows")
    print(f"{len(result.rows)} tables in {result.folder}")
    return EXIT_LOSS if result.missing or result.left_out.total() else EXIT_OK
