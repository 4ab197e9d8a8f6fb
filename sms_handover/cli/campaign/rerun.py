"""``sms-handover campaign rerun``: run one case again and compare it with its row."""

import json
import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from importlib import import_module
from pathlib import Path

import numpy as np

from sms_handover.analysis.equality import before, run_digest
from sms_handover.bag.run.reader import read_run
from sms_handover.campaign.cases.case import Cases, in_words, inputs_in_words
from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.cli.exit_codes import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_LOSS, EXIT_OK
from sms_handover.errors import ConfigurationError, GraphError, UnknownNameError
from sms_handover.launcher.run_folder import bag_of
from sms_handover.run_data import RunData
from sms_handover.simulation.save import save_run


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Run one case of a campaign again, in this process, and compare it with its row, bit for bit. With\n"
        "--bag run it as a graph of ROS 2 nodes and record it; with --view show the recording too."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover campaign rerun runs/laws 17 --law pid -o case_17.npz\n"
        "  sms-handover campaign rerun runs/laws 17 --law pid --bag -o runs/case_17 --view\n\n"
        "exit codes: 0 equal to its row, or there is none yet; 1 it differs; 2 wrong input; 3 messages are\n"
        "missing in the bag; 130 interrupted"
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder of a campaign")
    parser.add_argument("case", type=int, metavar="CASE", help="number of the case, from 0")
    parser.add_argument("--law", metavar="LAW", help="control law (default: the first of the campaign)")
    parser.add_argument("--scenario", metavar="NAME", help="scenario (default: the first of the campaign)")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="PATH", help="file for all arrays, .npz; with --bag a folder"
    )
    parser.add_argument("--bag", action="store_true", help="run it over DDS and record it to --output")
    parser.add_argument(
        "--view", action="store_true", help="then show the recording in a browser; with --bag"
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if options.view and not options.bag:
        raise ConfigurationError("--view shows a recording: give --bag too")
    if options.bag and not options.output:
        raise ConfigurationError("--bag needs --output FOLDER for the recording")
    folder = CampaignFolder(options.folder)
    task = _task(options, folder)
    row = next((entry.row for entry in folder.entries() if entry.row.task == task), None)
    with tempfile.TemporaryDirectory(prefix="sms_handover_rerun_") as scratch:
        cases = Cases(folder.frozen, folder.manifest.cases, Path(scratch))
        return (
            _recorded(options, cases, task, row, Path(scratch))
            if options.bag
            else _again(options, cases, task, row)
        )


def needs_ros(options: Namespace) -> bool:
    """Whether the options ask for a graph."""
    return bool(options.bag)


def _task(options: Namespace, folder: CampaignFolder) -> Task:
    """Return the case that the options name; raises ConfigurationError."""
    campaign = folder.campaign
    law, scenario = options.law or campaign.laws[0], options.scenario or next(iter(campaign.scenarios))
    if law not in campaign.laws:
        raise UnknownNameError("law", law, campaign.laws, f"campaign {campaign.name}")
    if scenario not in campaign.scenarios:
        raise UnknownNameError("scenario", scenario, campaign.scenarios, f"campaign {campaign.name}")
    if not 0 <= options.case < folder.cases:
        raise ConfigurationError(f"case is {options.case}, must be from 0 to {folder.cases - 1}")
    return Task(options.case, scenario, law)


def _again(options: Namespace, cases: Cases, task: Task, row: Row | None) -> int:
    """Run a case in this process."""
    result = cases.run(task)
    print(in_words(result.row, cases.campaign.worst_by))
    print(f"  {inputs_in_words(result.row.inputs)}")
    for name, value in result.row.metrics.items():
        print(f"  {name}: {'not defined' if value is None else f'{value:.6g}'}")
    if options.output and result.run is not None:
        save_run(result.run, options.output)
        print(f"arrays written to {options.output}")
    return _told(row, row is not None and row.text == result.row.text)


def _recorded(options: Namespace, cases: Cases, task: Task, row: Row | None, scratch: Path) -> int:
    """Run a case over DDS, record it, and compare the recording."""
    run, view = (import_module(f"sms_handover.cli.{name}") for name in ("run", "view"))
    values = {path: value for path, value in cases.values(task).items() if path != "law"}
    source = scratch / cases.campaign.scenarios[task.scenario].source
    words = [str(source), "--controller", task.law, "--output", str(options.output)]
    words += ["--compose", "--no-dry-run"]  # the same bits in half the time, and the row tells of collisions
    for path, value in values.items():
        words += ["-p", f"{path}:={json.dumps(value)}"]
    parser = ArgumentParser(prog="sms-handover run")
    run.add_parser(parser)
    try:
        ended = int(run.command(parser.parse_args(words)))
    except GraphError as error:  # a law without a plan ends its node
        if row is None or not row.cause or row.cause not in " ".join(str(error).split()):
            raise
        print(f"it ends as its row says: {row.cause}")
        code = _told_of_rest(row, options.output)
    else:
        if ended in (EXIT_LOSS, EXIT_INTERRUPTED):  # any other is of the mission, as in its row
            return ended
        equal = row is not None and run_digest(read_run(bag_of(options.output))) == row.run_digest
        code = _told(row, equal)
    if options.view:
        parser = ArgumentParser(prog="sms-handover view")
        view.add_parser(parser)
        view.command(parser.parse_args([str(options.output)]))
    return code


def _told_of_rest(row: Row, output: Path) -> int:
    """Tell whether a recording that ends without a plan is equal to its row; return the exit code."""
    if not row.run_digest:
        print("its row has no run to compare with: there was no plan from the first period on")
        return EXIT_OK
    return _told(row, run_digest(commanded(read_run(bag_of(output)))) == row.run_digest)


def commanded(run: RunData) -> RunData:
    """Return what there is of a run before its law gives up: the states after that have no command."""
    without = np.isnan(run.joint_command).all(axis=1)
    return before(run, int(run.tick_ns[without.argmax()])) if without.any() else run


def _told(row: Row | None, equal: bool) -> int:
    """Tell whether a case is equal to its row; return the exit code."""
    if row is None:
        print("the campaign has no row of it yet")
        return EXIT_OK
    print("equal to its row, bit for bit" if equal else "it DIFFERS from its row")
    return EXIT_OK if equal else EXIT_FAILED
