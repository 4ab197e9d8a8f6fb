"""``sms-handover reproduce``: run a bag's scenario again in one process and compare bit by bit."""

import tempfile
from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.launcher.run_folder import bags_of
from sms_handover.simulation.simulate import simulate
from sms_handover.units import ns_to_seconds


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Take parameters and schedule out of a bag, run them again in one process, and compare every state, "
        "command and reference with the recording, bit by bit. The robot description must be that of then."
    )
    parser.epilog = "exit codes: 0 every bit is the same; 1 they differ; 2 the bag cannot be used"
    parser.add_argument("run", type=Path, metavar="RUN", help="output folder of a lock-step run, or a bag")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    return max([_reproduce(bag) for bag in bags_of(options.run)])


def _reproduce(bag: Path) -> int:
    """Run a bag again, print what differs, and return the exit code.

    A run that was reset or ended early is compared up to its last state, without the command that would
    have answered it.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            recorded = read_run(bag)
            scenario = scenario_in(read_info(bag), Path(folder))
        except BagError as error:
            raise ConfigurationError(str(error)) from error  # exit code 2: what was given cannot be used
        again = simulate(scenario)
    ended_early = recorded.tick_ns.size < again.tick_ns.size
    if ended_early:
        end_ns = int(recorded.tick_ns[-1])
        recorded, again = before(recorded, end_ns), before(again, end_ns)
    differences = compare_runs(recorded, again)
    for difference in differences:
        print(difference)
    if not differences:
        until = f", up to {ns_to_seconds(end_ns):g} s where the run was ended" if ended_early else ""
        states, references = recorded.tick_ns.size, recorded.reference_ns.size
        print(f"the same bit for bit: {states} states, {references} references{until}")
    return 1 if differences else 0
