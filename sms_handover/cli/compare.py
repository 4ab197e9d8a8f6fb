"""``sms-handover compare``: recorded runs side by side, with the paper's claims."""

import csv
import json
from argparse import ArgumentParser, Namespace
from io import StringIO
from pathlib import Path

from sms_handover.analysis.records import Record, records_of
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.cli.recorded_runs import read_all
from sms_handover.cli.text_files import write_text
from sms_handover.report.recorded_run import common_tolerance, compare_recorded


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Read bags and print what happened in each, side by side. With one run under nmpc and one under pid "
        "the paper's claims are judged. docs/metrics.md defines every figure."
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a JSON file too")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write them to a CSV file too, one per row")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    recorded = read_all(options.runs)
    comparison = compare_recorded(recorded)
    print(render(comparison, common_tolerance(recorded)))
    if options.csv:
        table = StringIO()
        csv.writer(table, lineterminator="\n").writerows([Record._fields, *records_of(comparison)])
        write_text(options.csv, table.getvalue())
    if options.json:
        write_text(options.json, json.dumps(summary(comparison), indent=2) + "\n")
    return 0
