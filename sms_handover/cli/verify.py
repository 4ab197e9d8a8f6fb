"""``sms-handover verify``: compute recorded runs again and compare, bit by bit or with another engine."""

import json
import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from sms_handover.analysis.equality import as_far_as_recorded, before, compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.cli.exit_codes import EXIT_FAILED, EXIT_OK, EXIT_UNSUPPORTED
from sms_handover.engines.protocol import Engine
from sms_handover.engines.registry import ENGINES, load_engine
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.launcher.recorded_engine import recorded_verdict
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.launcher.run_folder import bags_of
from sms_handover.simulation.simulate import simulate
from sms_handover.units import ns_to_seconds


class Way(NamedTuple):
    """What computes a run again: in words, how (bag, ROS domain -> exit code), and whether over DDS."""

    text: str
    verify: Callable[[Path, int | None], int]
    over_dds: bool = False


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Take the scenario out of each bag, compute the run again, and compare it with the recording: bit\n"
        "by bit, or with another engine, within the bounds of its scenario (docs/second_engine.md)."
    )
    texts = {name: way.text for name, way in WAYS.items()} | {n: e.text for n, e in ENGINES.items()}
    listed = "\n".join(f"  {name:<9} {text}" for name, text in texts.items())
    parser.epilog = (
        f"with:\n{listed}\n\n"
        "examples:\n"
        "  sms-handover verify runs/nmpc\n"
        "  sms-handover verify runs/nmpc --with mujoco --json\n\n"
        "exit codes: 0 every bit is the same, or every difference within its bound; 1 they differ, or the\n"
        "plant exited; 2 a bag cannot be used; 5 the other engine does not support what the run has"
    )
    parser.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="output folder of a lock-step run, or a bag"
    )
    parser.add_argument(
        "--with",
        dest="engine",
        choices=(*WAYS, *ENGINES),
        default="self",
        help="what computes it again, see below (default: self)",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the verdicts of another engine as a JSON list"
    )
    parser.add_argument(
        "--domain-id", type=int, metavar="N", help="ROS domain of --with plant (default: a free one)"
    )


def needs_ros(options: Namespace) -> bool:
    """Return whether the run is computed over DDS."""
    return options.engine in WAYS and WAYS[options.engine].over_dds


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if options.domain_id is not None and not needs_ros(options):
        raise ConfigurationError("--domain-id is for a verification over DDS: give --with plant with it")
    if options.engine in ENGINES:
        return _by_engine(load_engine(options.engine), options.runs, as_json=options.json)
    if options.json:
        known = " or ".join(f"--with {name}" for name in ENGINES)
        raise ConfigurationError(f"--json is for another engine: give {known} with it")
    codes = []
    for run in options.runs:
        if len(options.runs) > 1:
            print(f"{run}:", flush=True)
        codes += [WAYS[options.engine].verify(bag, options.domain_id) for bag in bags_of(run)]
    return max(codes)


def _by_engine(engine: Engine, runs: Sequence[Path], *, as_json: bool) -> int:
    """Let an engine replay runs, print what it says of each, and return the exit code."""
    codes, found = [], []
    for bag in (bag for run in runs for bag in bags_of(run)):
        verdict = recorded_verdict(engine, bag)
        found.append({"bag": str(bag), **verdict.plain()})
        codes.append(EXIT_UNSUPPORTED if verdict.unsupported else EXIT_OK if verdict.agrees else EXIT_FAILED)
        if not as_json:
            print(*([f"{bag}:"] if len(runs) > 1 else []), *verdict.lines(), sep="\n", flush=True)
    if as_json:
        print(json.dumps(found, indent=2))
    return EXIT_FAILED if EXIT_FAILED in codes else max(codes)


def _by_itself(bag: Path, domain_id: int | None) -> int:
    """Run a bag again, print what differs, and return the exit code.

    A run that was reset or ended early is compared up to its last state, without the command that would
    have answered it; one of an older version without what that did not record.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            recorded = read_run(bag)
            scenario = scenario_in(read_info(bag), Path(folder))
        except BagError as error:
            raise ConfigurationError(str(error)) from error  # exit code 2: what was given cannot be used
        again = simulate(scenario, base_wrenches=recorded.base_wrenches)
    ended_early = recorded.tick_ns.size < again.tick_ns.size
    if ended_early:
        end_ns = int(recorded.tick_ns[-1])
        recorded, again = before(recorded, end_ns), before(again, end_ns)
    again, missing = as_far_as_recorded(recorded, again)
    if missing:
        print(f"not recorded, as by an older version, so not compared: {', '.join(missing)}")
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
    from sms_handover.launcher.closed_loop import closed_loop  # noqa: PLC0415  (nothing else here needs ROS)

    return closed_loop(bag, domain_id)


WAYS: Mapping[str, Way] = MappingProxyType(
    {
        "self": Way(
            "one process, without ROS: every state, command and reference of the whole loop", _by_itself
        ),
        "plant": Way(
            "a live plant over DDS that is given the recorded commands: every state", _by_plant, over_dds=True
        ),
    }
)
