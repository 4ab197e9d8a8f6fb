"""``sms-handover bag info``: show the contents of a bag."""

import json
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Iterable, Mapping
from pathlib import Path

from sms_handover.bag.info import BagInfo, TopicInfo, read_info
from sms_handover.bag.ledger import ledger_table
from sms_handover.bag.overview import overview
from sms_handover.cli.exit_codes import EXIT_OK
from sms_handover.launcher.run_folder import bag_of
from sms_handover.units import NS_PER_S

_BYTES_PER_MIB = 2**20


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Print what 'ros2 bag info' prints, and controller, schedule, versions, seed and loss ledger of a\n"
        "bag of sms-handover. Only the summaries of the files are read; 'bag check' reads all of it."
    )
    parser.epilog = "exit codes: 0 ok; 1 unreadable bag"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    info = read_info(bag_of(options.bag))
    print(json.dumps(overview(info), indent=2) if options.json else _text(info))
    return EXIT_OK


def _text(info: BagInfo) -> str:
    """Return the contents of a bag as text."""
    values = overview(info)
    head = {
        "Files": ", ".join(file.name for file in info.files),
        "Bag size": f"{info.size / _BYTES_PER_MIB:.1f} MiB",
        "Storage id": "mcap",
        "Profile, library": f"{info.profile or '-'}, {info.library or '-'}",
        "Duration": _seconds(info.duration_ns),
        "Start": _seconds(info.start_ns),
        "End": _seconds(info.end_ns),
        "Messages": str(info.message_count),
    }
    lines = [*_table(head), "", *_topics(info.channels)]
    for title, part in (("Run", values["run"]), ("Made by", values["provenance"])):
        if isinstance(part, Mapping) and part:
            lines += ["", f"{title}:", *_table({f"  {name}": str(value) for name, value in part.items()})]
    if info.attachments:
        files = ", ".join(f"{name} ({len(content)} bytes)" for name, content in info.attachments.items())
        lines += ["", f"Attachments: {files}"]
    lines += ["", f"Records: {', '.join(info.records) or 'none'}"]
    if info.ledger is None:
        lines += ["", "Loss ledger: none, not recorded by sms-handover"]
    else:
        verdict = "complete" if info.ledger.complete else "NOT complete"
        lines += ["", f"Loss ledger, {verdict}:", ledger_table(info.ledger)]
    return "\n".join(lines)


def _topics(topics: Iterable[TopicInfo]) -> list[str]:
    """Return a line per topic."""
    cells = [(topic.name, topic.type or "-", str(topic.message_count), topic.encoding) for topic in topics]
    rows = [("topic", "type", "messages", "serialization"), *cells]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return [
        f"{name:<{widths[0]}}  {kind:<{widths[1]}}  {count:>{widths[2]}}  {encoding}".rstrip()
        for name, kind, count, encoding in rows
    ]


def _seconds(time_ns: int) -> str:
    """Return a time in s with all nanoseconds, which a float of wall time would not hold."""
    return f"{time_ns // NS_PER_S}.{time_ns % NS_PER_S:09d} s"


def _table(values: Mapping[str, str]) -> list[str]:
    """Return names and values in two columns."""
    width = max(map(len, values)) + 1
    return [f"{name + ':':<{width}}  {value}" for name, value in values.items()]
