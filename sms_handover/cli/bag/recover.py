"""``sms-handover bag recover``: recover a truncated or damaged bag."""

import json
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.bag.ledger import ledger_table
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.repair.recovery import Recovery
from sms_handover.cli.exit_codes import EXIT_LOSS, EXIT_OK
from sms_handover.launcher.run_folder import bag_of
from sms_handover.terminal.progress import byte_progress
from sms_handover.units import NS_PER_S

_MOST = 20  # damaged places that are listed
_NS_PER_MS = 1e6


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write everything readable of a bag to a new one, with index and metadata.yaml, and report what is\n"
        "lost. Damaged chunks are skipped; no message is altered. Attachments and metadata records are\n"
        "kept, the loss ledger is rebuilt. The bag itself is not changed."
    )
    parser.epilog = "exit codes: 0 nothing lost; 3 something lost; 1 nothing could be recovered"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="new folder (default: <bag>_recovered beside BAG)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    path = bag_of(options.bag)
    output = options.output or _beside(path)
    with byte_progress("recovering") as progress:
        result = recover(path, output, progress)
    print(json.dumps(_values(result), indent=2) if options.json else _text(result))
    return EXIT_OK if result.clean else EXIT_LOSS


def _beside(path: Path) -> Path:
    """Return the default folder of the new bag."""
    whole = path.resolve()
    return whole.with_name(f"{whole.stem if whole.is_file() else whole.name}_recovered")


def _values(result: Recovery) -> dict[str, object]:
    """Return a result for JSON."""
    return {
        **{key: json.loads(text) for key, text in result.to_record().items()},
        "output": str(result.folder),
        "clean": result.clean,
        "messages": {topic.name: topic.recovered for topic in result.topics},
        "messages_from_a_cut_chunk": result.from_cut_chunk,
    }


def _text(result: Recovery) -> str:
    """Return a result as text."""
    lines = [f"lost: {damage}" for damage in result.losses[:_MOST]]
    if len(result.losses) > _MOST:
        lines.append(f"lost: {len(result.losses) - _MOST} more places")
    lines += [
        f"{topic.name}: {topic.lost} of {topic.recorded} messages lost"
        for topic in result.topics
        if topic.lost
    ]
    lines += [f"{name} is not there, metadata.yaml lists it" for name in result.missing]
    if result.private:
        lines.append(f"{result.private} private records are not kept")
    if result.from_cut_chunk:
        lines.append(f"{result.from_cut_chunk} messages come from a chunk cut off by the end of the file")
    if result.largest_loss_ns:
        lines.append(f"largest loss: {result.largest_loss_ns / _NS_PER_MS:.3f} ms of log time")
    if not result.ends_known:
        lines.append("the damage reaches an end of the bag, so its extent is unknown")
    if not result.closed:
        lines.append("the recording was not closed: what the recorder had not written yet is lost")
    if result.ledger is not None:
        lines += ["", ledger_table(result.ledger), ""]
    lines.append(
        f"recovered {result.message_count} messages on {len(result.topics)} topics{_span(result)} into"
        f" {result.folder}; {result.lost_bytes} of {result.size} bytes lost"
    )
    return "\n".join(lines)


def _span(result: Recovery) -> str:
    """Return the time span as text."""
    if result.start_ns is None or result.end_ns is None:
        return ""
    return f", log time {result.start_ns / NS_PER_S:.3f} to {result.end_ns / NS_PER_S:.3f} s,"
