"""``sms-handover bag info``: what a bag holds."""

import json
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence
from pathlib import Path

from sms_handover.bag.info import BagInfo, TopicInfo, read_info
from sms_handover.bag.ledger import ledger_table
from sms_handover.bag.overview import overview
from sms_handover.cli.exit_codes import EXIT_LOSS, EXIT_OK
from sms_handover.launcher.run_folder import bag_of
from sms_handover.units import NS_PER_S

_BYTES_PER_MIB = 2**20


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Print what 'ros2 bag info' prints, and what bags of sms-handover hold besides: controller,\n"
        "schedule, versions, seed and loss ledger. Only the ends of the files are read:\n"
        "'bag check' looks at the rest."
    )
    parser.epilog = "exit codes: 0 ok; 1 the bag cannot be read"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    info = read_info(bag_of(options.bag))
    print(json.dumps(overview(info), indent=2) if options.json else _text(info))
    return EXIT_LOSS if info.missing else EXIT_OK


def _text(info: BagInfo) -> str:
    """Return what a bag holds as lines of text."""
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
    lines += [f"MISSING  {text}" for text in info.missing] + [f"note     {text}" for text in info.notes]
    for title, part in (("Run", values["run"]), ("Made by", values["provenance"])):
        if isinstance(part, Mapping) and part:
            lines += ["", f"{title}:", *_table({f"  {name}": str(value) for name, value in part.items()})]
    if info.attachments:
        files = ", ".join(f"{name} ({len(content)} bytes)" for name, content in info.attachments.items())
        lines += ["", f"Attachments: {files}"]
    lines += ["", f"Records: {', '.join(info.records) or 'none'}"]
    if info.ledger is None:
        lines += ["", "Loss ledger: none, the bag was not recorded by sms-handover"]
    else:
        verdict = "complete" if info.ledger.complete else "NOT complete"
        lines += ["", f"Loss ledger, {verdict}:", ledger_table(info.ledger)]
    return "\n".join(lines)


def _topics(topics: Sequence[TopicInfo]) -> list[str]:
    """Return a line per topic."""
    rows = [("topic", "type", "messages", "serialization"), *map(_cells, topics)]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return [
        f"{name:<{widths[0]}}  {kind:<{widths[1]}}  {count:>{widths[2]}}  {encoding}".rstrip()
        for name, kind, count, encoding in rows
    ]


def _cells(topic: TopicInfo) -> tuple[str, str, str, str]:
    """Return the cells of a topic."""
    return topic.name, topic.type or "-", str(topic.message_count), topic.encoding


def _seconds(time_ns: int) -> str:
    """Return a time in s with every nanosecond, which a float would not hold of a wall clock."""
    return f"{time_ns // NS_PER_S}.{time_ns % NS_PER_S:09d} s"


def _table(values: Mapping[str, str]) -> list[str]:
    """Return names and values in two columns."""
    width = max(map(len, values)) + 1
    return [f"{name + ':':<{width}}  {value}" for name, value in values.items()]
