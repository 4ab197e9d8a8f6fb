"""``sms-handover campaign merge``: merge the folders of shards into one."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.campaign.definition.frozen import CAMPAIGN_FILE
from sms_handover.campaign.record.campaign_folder import merge
from sms_handover.campaign.statistics.extent import extent_of
from sms_handover.campaign.statistics.worst_cases import for_shell
from sms_handover.cli.campaign.outputs import tell_outputs
from sms_handover.cli.exit_codes import EXIT_INTERRUPTED, EXIT_LOSS, EXIT_OK


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Write a new folder with the rows of several folders of one campaign, such as those of its shards. "
        "Two rows of one case must be equal."
    )
    parser.epilog = (
        "exit codes: 0 every case has a row; 1 it cannot be written; 2 wrong input; 3 cases are missing, or "
        "not every worst case could be kept; 130 interrupted"
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="folder of a campaign")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="new folder")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    with merge(options.output, options.folders) as merged:
        for fault in merged.faults:
            print(fault, file=sys.stderr)
        extent = extent_of(merged, list(merged.entries()))
        print(f"{extent.rows} of {extent.runs} rows", flush=True)
        try:
            is_whole = tell_outputs(options.output)
        except KeyboardInterrupt:
            file, folder = (for_shell(str(path)) for path in (options.output / CAMPAIGN_FILE, options.output))
            goes_on = f"'sms-handover campaign run {file} -o {folder}' goes on"
            print(f"interrupted: all rows are in {options.output}; {goes_on}", file=sys.stderr)
            return EXIT_INTERRUPTED
    return EXIT_OK if extent.is_whole and is_whole else EXIT_LOSS
