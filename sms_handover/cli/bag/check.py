"""``sms-handover bag check``: check whether a bag is complete, and what is missing."""

import json
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.bag.files import recover_hint
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import CheckResult, Severity
from sms_handover.cli.exit_codes import EXIT_LOSS, EXIT_OK
from sms_handover.launcher.run_folder import bags_of
from sms_handover.terminal.progress import byte_progress

_MARKS = {Severity.DAMAGED: "DAMAGED", Severity.MISSING: "MISSING", Severity.NOTE: "note"}


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Read every byte of a bag and check whether it is complete: checksums, index and counts against\n"
        "the file, metadata.yaml against both, schemas, stamps against the loss ledger, messages published\n"
        "against messages recorded, and whether the run was finished."
    )
    parser.epilog = "exit codes: 0 complete; 3 damaged or incomplete; 1 not a bag"
    parser.add_argument("bag", type=Path, metavar="BAG", help="run folder, bag folder or .mcap file")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    results = []
    for path in bags_of(options.bag):
        with byte_progress("checking") as progress:
            results.append(check(path, progress))
    if options.json:
        values = [_values(result) for result in results]
        print(json.dumps(values if len(values) > 1 else values[0], indent=2))
    else:
        print("\n".join(map(_text, results)))
    return EXIT_OK if all(result.complete for result in results) else EXIT_LOSS


def _values(result: CheckResult) -> dict[str, object]:
    """Return a result for JSON."""
    return {
        "bag": str(result.path),
        "complete": result.complete,
        "messages": result.counts,
        "findings": [
            {"severity": finding.severity.value, "text": finding.text} for finding in result.findings
        ],
    }


def _text(result: CheckResult) -> str:
    """Return a result as text."""
    width = max(map(len, _MARKS.values()))
    lines = [f"{_MARKS[finding.severity]:<{width}}  {finding.text}" for finding in result.findings]
    count, number = sum(result.counts.values()), len(result.counts)
    verdict = "complete" if result.complete else "NOT complete"
    lines.append(f"{result.path} is {verdict}: {count} messages on {number} topics")
    if result.damaged:
        lines.append(recover_hint(result.path))
    return "\n".join(lines)
