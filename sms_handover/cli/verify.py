"""``sms-handover verify``: compute recorded runs again and compare bit by bit."""

import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.launcher.run_folder import bags_of
from sms_handover.simulation.simulate import simulate
from sms_handover.units import ns_to_seconds


class Engine(NamedTuple):
    """What computes a run again: in words, how (bag, ROS domain -> exit code), and whether over DDS."""

    text: str
    verify: Callable[[Path, int | None], int]
    over_dds: bool = False


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Take the scenario out of each bag, compute the run again, and compare it with the recording bit by\n"
        "bit."
    )
    listed = "\n".join(f"  {name:<6} {engine.text}" for name, engine in ENGINES.items())
    parser.epilog = (
        f"with:\n{listed}\n\n"
        "exit codes: 0 every bit is the same; 1 they differ, or the plant exited; 2 a bag cannot be used"
    )
    parser.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="output folder of a lock-step run, or a bag"
    )
    parser.add_argument(
        "--with",
        dest="engine",
        choices=tuple(ENGINES),
        default="self",
        help="what computes it again, see below (default: self)",
    )
    parser.add_argument(
        "--domain-id", type=int, metavar="N", help="ROS domain of --with plant (default: a free one)"
    )


def needs_ros(options: Namespace) -> bool:
    """Return whether the chosen engine runs over DDS."""
    return ENGINES[options.engine].over_dds


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    engine = ENGINES[options.engine]
    if options.domain_id is not None and not engine.over_dds:
        raise ConfigurationError("--domain-id is for a verification over DDS: give --with plant with it")
    codes = []
    for run in options.runs:
        if len(options.runs) > 1:
            print(f"{run}:", flush=True)
        codes += [engine.verify(bag, options.domain_id) for bag in bags_of(run)]
    return max(codes)


def _by_itself(bag: Path, domain_id: int | None) -> int:
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


def _by_plant(bag: Path, domain_id: int | None) -> int:
    """Give the commands of a bag to a live plant, print what differs, and return the exit code."""
    from sms_handover.launcher.closed_loop import closed_loop  # noqa: PLC0415  (the other engine needs no ROS)

    return closed_loop(bag, domain_id)


ENGINES: Mapping[str, Engine] = MappingProxyType(
    {
        "self": Engine(
            "one process, without ROS: every state, command and reference of the whole loop", _by_itself
        ),
        "plant": Engine(
            "a live plant over DDS that is given the recorded commands: every state", _by_plant, over_dds=True
        ),
    }
)
