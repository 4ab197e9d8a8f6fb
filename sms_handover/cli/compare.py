"""``sms-handover compare``: recorded runs side by side, with the paper's claims."""

import csv
import json
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from io import StringIO
from pathlib import Path
from types import MappingProxyType

from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.grasps import Tolerance
from sms_handover.analysis.latex import latex_table
from sms_handover.analysis.records import Record, records_of
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import figure_sections, render
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.cases_table import TABLE
from sms_handover.campaign.record.journal import JOURNAL, JournalFaults
from sms_handover.campaign.statistics.campaign_text import campaign_text, campaign_values
from sms_handover.campaign.statistics.case_columns import columns_of
from sms_handover.campaign.statistics.extent import extent_of
from sms_handover.campaign.statistics.tables import outcome_sections
from sms_handover.cli.recorded_runs import campaign_among, read_all
from sms_handover.cli.text_files import write_text
from sms_handover.errors import ConfigurationError
from sms_handover.report.recorded_run import common_tolerance, compare_recorded

_STANDARD_OUTPUT = Path("-")

Text = Callable[[Comparison, Tolerance | None], str]


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Read bags and print what happened in each, side by side. With one run under nmpc and one under pid "
        "the paper's claims are judged. docs/metrics.md defines every figure. Of the folder of a campaign "
        "print its laws side by side, with intervals and paired tests."
    )
    parser.epilog = "A FILE that is - is standard output, in place of the table."
    parser.add_argument(
        "runs",
        nargs="+",
        type=Path,
        metavar="RUN",
        help="output folder of a run, or a bag; or the folder of one campaign",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a JSON file too")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write them to a CSV file too, one per row")
    parser.add_argument(
        "--latex",
        type=Path,
        metavar="FILE",
        help="write the table for LaTeX too, without the claims; needs the packages booktabs and longtable",
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    wanted = {name: path for name in _TEXTS if (path := getattr(options, name)) is not None}
    printed = [name for name, path in wanted.items() if path == _STANDARD_OUTPUT]
    if len(printed) > 1:
        raise ConfigurationError(f"--{' and --'.join(printed)} cannot both be standard output: name a FILE")
    campaign = campaign_among(options.runs)
    if campaign:
        return _compare_laws(campaign, wanted)
    recorded = read_all(options.runs)
    comparison, tolerance = compare_recorded(recorded), common_tolerance(recorded)
    if not printed:
        print(render(comparison, tolerance))
    for name, path in wanted.items():
        text = _TEXTS[name](comparison, tolerance)
        if path == _STANDARD_OUTPUT:
            sys.stdout.write(text)
        else:
            write_text(path, text)
    return 0


def _compare_laws(folder: CampaignFolder, wanted: Mapping[str, Path]) -> int:
    """Print the laws of a campaign side by side; return the exit code."""
    if "csv" in wanted:
        raise ConfigurationError(f"--csv is for runs: the cases of {folder.path} are in its {TABLE}")
    faults = JournalFaults()
    campaign, entries = folder.campaign, list(folder.entries(faults))
    for fault in faults.in_words(folder.path / JOURNAL):
        print(fault, file=sys.stderr)
    columns, extent = columns_of(entries), extent_of(folder, entries)
    texts: Mapping[str, Callable[[], str]] = {
        "json": lambda: json.dumps(campaign_values(campaign, columns, extent), indent=2) + "\n",
        "latex": lambda: latex_table(campaign.laws, outcome_sections(campaign, columns)),
    }
    if _STANDARD_OUTPUT not in wanted.values():
        print(campaign_text(campaign, columns, extent))
    for name, path in wanted.items():
        if path == _STANDARD_OUTPUT:
            sys.stdout.write(texts[name]())
        else:
            write_text(path, texts[name]())
    return 0


def _json(comparison: Comparison, tolerance: Tolerance | None) -> str:
    """Return the figures as JSON."""
    return json.dumps(summary(comparison), indent=2) + "\n"


def _csv(comparison: Comparison, tolerance: Tolerance | None) -> str:
    """Return the figures as CSV, one per row."""
    table = StringIO()
    csv.writer(table, lineterminator="\n").writerows([Record._fields, *records_of(comparison)])
    return table.getvalue()


def _latex(comparison: Comparison, tolerance: Tolerance | None) -> str:
    """Return the table of the figures for LaTeX."""
    return latex_table(list(comparison.runs), figure_sections(comparison, tolerance))


_TEXTS: Mapping[str, Text] = MappingProxyType({"json": _json, "csv": _csv, "latex": _latex})
