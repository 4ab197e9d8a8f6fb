"""``sms-handover campaign status``: how far a campaign is, what failed, which cases are worst."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from textwrap import fill

from sms_handover.analysis.layout import WIDTH
from sms_handover.campaign.cases.case import in_words, inputs_in_words
from sms_handover.campaign.cases.case_row import Row
from sms_handover.campaign.cases.retained import worst_path
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.journal import JOURNAL, JournalFaults
from sms_handover.campaign.statistics.extent import extent_of
from sms_handover.campaign.statistics.notes import note_on_stop
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.worst_cases import failed, failures_by_cause, rerun_command, worst_of
from sms_handover.cli.columns import columns
from sms_handover.cli.exit_codes import EXIT_LOSS, EXIT_OK
from sms_handover.errors import ConfigurationError

_MOST = 50  # [-] failures that are listed


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Show how far a campaign is, also while it runs; with --failed or --worst its cases too."
    )
    parser.epilog = (
        "exit codes: 0 every case has a row, or it stopped early; 2 wrong input; 3 cases are missing"
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder of a campaign")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--failed", action="store_true", help="list causes, and the first cases without success"
    )
    which.add_argument(
        "--worst", type=int, default=0, metavar="K", help="list the K worst cases of each law by 'worst_by'"
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if options.worst < 0:
        raise ConfigurationError(f"--worst is {options.worst}, must be >= 0")
    folder, faults = CampaignFolder(options.folder), JournalFaults()
    campaign = folder.campaign
    entries = list(folder.entries(faults))
    for fault in faults.in_words(folder.path / JOURNAL):
        print(fault, file=sys.stderr)
    extent = extent_of(folder, entries)
    print("\n".join(extent.in_words), end="\n\n")
    head = ("scenario", "law", "rows", "success", "numeric failures")
    table = []
    for scenario in campaign.scenarios:
        for law in campaign.laws:
            rows = [entry.row for entry in entries if entry.row.task[1:] == (scenario, law)]
            successes = proportion(sum(row.succeeded for row in rows), len(rows))
            numeric = sum(row.numeric_failure for row in rows)
            table.append((scenario, law, str(len(rows)), str(successes), str(numeric)))
    print(columns([head, *table]))
    note = note_on_stop(campaign.stop, extent.stopped_at)
    if note:
        print("\n" + fill(note, WIDTH))
    one_scenario, listed = len(campaign.scenarios) == 1, list[Row]()
    if options.failed:
        causes = failures_by_cause(entries).most_common()
        heads = ("scenario", "law", "status", "times", "cause")
        told = columns([heads, *((*who, str(times), cause) for (*who, cause), times in causes)])
        print(f"\n{told if causes else extent.without_failure}")
        listed = list(failed(entries))
    elif options.worst:
        listed = [
            row for rows in worst_of(entries, campaign.worst_by, options.worst).values() for row in rows
        ]
        if not listed:
            print(f"\nNo case has {campaign.worst_by}.")
    for row in listed if options.worst else listed[:_MOST]:
        print(f"\n{in_words(row, campaign.worst_by)}\n  {inputs_in_words(row.inputs)}")
        print(f"  {rerun_command(str(folder.path), row.task, one_scenario=one_scenario)}")
        kept = worst_path(folder.path, campaign.keep, row.task)
        if kept.exists():
            print(f"  kept whole: {kept}")
    if options.failed and len(listed) > _MOST:
        print(f"\nand {len(listed) - _MOST} more")
    return EXIT_OK if extent.is_whole else EXIT_LOSS
