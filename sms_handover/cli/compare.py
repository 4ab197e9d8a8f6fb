"""``sms-handover compare``: recorded runs side by side, with the paper's claims."""

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.cli.recorded import read_all
from sms_handover.report.recorded_run import common_tolerance


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Read bags and print what happened in each, side by side. With one run under nmpc and one under pid "
        "the paper's claims are judged. docs/metrics.md defines every figure."
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a JSON file too")


def command(options: Namespace) -> int:
    """Carry out the command; return the exit code."""
    recorded = read_all(options.runs)
    comparison = compare(
        {run.name: run.data for run in recorded},
        laws={run.name: run.law for run in recorded},
        loops={run.name: run.loop for run in recorded},
    )
    print(render(comparison, common_tolerance(recorded)))
    if options.json:
        options.json.write_text(json.dumps(summary(comparison), indent=2) + "\n", encoding="utf-8")
    return 0
