"""``sms-handover run``: the handover as a graph of ROS 2 nodes, recorded."""

import os
import shlex
import shutil
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path

from sms_handover.cli.collisions import add_dry_run_options, check_collisions
from sms_handover.cli.exit_codes import EXIT_INTERRUPTED, EXIT_LOSS
from sms_handover.cli.options import add_scenario_options, scenario_of
from sms_handover.cli.task_code import task_code
from sms_handover.errors import ConfigurationError
from sms_handover.graph.events import graver_in_words
from sms_handover.graph.topics import CONTROLLER, NODES, RECORDER
from sms_handover.launcher.domain import reservation
from sms_handover.launcher.launcher import LaunchPlan, launch
from sms_handover.launcher.node_server import NodeServer
from sms_handover.launcher.run_folder import BAG, LOGS, locked_logs
from sms_handover.launcher.wake_ups import measure_wake_ups
from sms_handover.ros.launching.composition import listed, placed
from sms_handover.ros.process.network_scope import network_scope_to
from sms_handover.ros.process.realtime import exact_timers
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.parameters import LOCKSTEP, REALTIME
from sms_handover.simulation.scenario import Scenario
from sms_handover.units import ns_to_seconds

OWN = "own"  # in the name of the output folder, for a law whose name is not known
_AT_ONCE = 100  # most runs that start within one second without a given output folder


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Start plant, trajectory, ik, controller and recorder as ROS 2 nodes, run the handover, and end "
        "every process. The bag goes to OUTPUT/bag, what the nodes print to OUTPUT/log."
    )
    parser.epilog = (
        "exit codes: 0 the run is whole; 1 a node died or stalled, or the task failed; 2 wrong input, "
        "nothing was started; 3 messages are missing in the bag; 4 a grasp missed and no retry "
        "mended it; 130 interrupted. "
        "To look at the running graph with other tools, give --domain-id and set ROS_DOMAIN_ID to it."
    )
    parser.set_defaults(node_server=None)  # the program has one; who calls this from elsewhere need not
    add_scenario_options(parser)
    add_dry_run_options(parser)
    group = parser.add_argument_group("graph")
    group.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="new folder (default: runs/<law>_<date>_<time>)"
    )
    group.add_argument(
        "--overwrite", action="store_true", help="replace the output folder if an earlier run made it"
    )
    group.add_argument("--no-record", action="store_true", help="run without a recorder")
    group.add_argument(
        "--real-time", action="store_true", help="pace the plant by the wall clock instead of lock step"
    )
    group.add_argument(
        "--compose",
        action="store_true",
        help="run nodes that wait for each other in one process, which is two to three times as fast: in "
        "lock step plant, trajectory, ik and controller, in real time plant and controller",
    )
    controller = group.add_mutually_exclusive_group()
    controller.add_argument(
        "--own-controller",
        metavar="COMMAND",
        help="start this program as the node 'controller' in place of ours; parameters of it are given as "
        "-p controller.NAME:=VALUE (docs/own_controller.md)",
    )
    controller.add_argument(
        "--without-controller",
        action="store_true",
        help="start no controller: the run begins when your own node 'controller' has joined",
    )
    group.add_argument(
        "--domain-id", type=int, metavar="N", help="ROS domain (default: a free one of this machine's)"
    )
    group = parser.add_argument_group(
        "several hosts",
        "The same command on each host, with the same scenario and domain; see docs/hosts.md.",
    )
    group.add_argument(
        "--nodes",
        default="",
        metavar="NODE,...",
        help=f"start only these here, because the others are started elsewhere (default: {','.join(NODES)})",
    )
    group.add_argument(
        "--peers",
        default="",
        metavar="HOST,...",
        help="names or addresses of the other hosts. This opens the graph to the network: whoever reaches "
        "this machine can then read and command it (default: this machine only)",
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    mode = REALTIME if options.real_time else LOCKSTEP
    here, elsewhere = placed(options.nodes, record=not options.no_record)
    scope = network_scope_to(listed(options.peers))
    if (elsewhere or scope.hosts) and options.domain_id is None:
        raise ConfigurationError(
            "nodes of several hosts meet on a ROS domain: give each host the same --domain-id"
        )
    own = _own_controller(options)
    external = (CONTROLLER,) if own or options.without_controller else ()
    scenario = scenario_of(options, mode, recorded=not options.no_record, external=external)
    check_scenario(scenario)
    _check_output(options)
    with ExitStack() as stack:
        held = stack.enter_context(reservation(options.domain_id, shared=bool(elsewhere)))
        check_collisions(scenario, options)  # takes seconds: what can be told at once has been told
        if _replaces(options):
            stack.enter_context(_earlier_run_aside(options.output))
        output, lock = stack.enter_context(_output_folder(options, scenario))
        plan = LaunchPlan(
            scenario=scenario,
            parameter_files=tuple(path.resolve() for path in options.params_file),
            domain=held.domain,
            log_folder=output / LOGS,
            bag=output / BAG if RECORDER in here else None,
            compose=options.compose,
            controller=own,
            inherited=(*held.descriptors, lock),
            nodes=here,
            elsewhere=elsewhere,
            scope=scope,
            server=options.node_server,
        )
        where = options.output or output
        print(f"running on ROS domain {held.domain}, {scope}; output in {where}", flush=True)
        if elsewhere:
            print(f"this host runs {', '.join(here)}; waiting for {', '.join(elsewhere)}", flush=True)
        if options.without_controller:
            print(_how_to_join(held.domain), flush=True)
        if options.real_time:
            print(_forecast(scenario, plan.server, composed=options.compose), flush=True)
        outcome = launch(plan)
    progress = outcome.progress
    print(outcome.recorder_said, end="")
    if summary := graver_in_words(progress.run_events):
        print(f"the nodes reported {summary}, see above")
    print(f"{progress.detail} at {ns_to_seconds(progress.stamp_ns):g} s of simulated time")
    if outcome.interrupted:
        return EXIT_INTERRUPTED
    if outcome.recorder_code:
        print("messages are missing in the bag, see the table above", file=sys.stderr)
        return EXIT_LOSS
    return task_code(progress.events, progress.run_events, failed=progress.failed)


def _forecast(scenario: Scenario, server: NodeServer | None, *, composed: bool) -> str:
    """Return in one line how well this machine will keep real time."""
    if server is not None:
        server.wait_until_ready()  # what it imports would be taken for the noise of the machine
    exact_timers()
    common = scenario.parameters.common
    wake_ups = measure_wake_ups(common.tick)
    return wake_ups.forecast(common.tick, common.reference_period, composed=composed)


def _own_controller(options: Namespace) -> tuple[str, ...]:
    """Return the command line of the user's own controller, () if none is given."""
    if options.own_controller is None:
        return ()
    if options.controller is not None:
        raise ConfigurationError("--controller chooses a law of ours, --own-controller replaces it: give one")
    try:
        words = tuple(shlex.split(options.own_controller))
    except ValueError as error:
        raise ConfigurationError(f"--own-controller {options.own_controller!r}: {error}") from error
    if not words:
        raise ConfigurationError("--own-controller is empty, expected a command, e.g. 'python3 mine.py'")
    if shutil.which(words[0]) is None:
        raise ConfigurationError(f"--own-controller: there is no program {words[0]!r}")
    return words


def _how_to_join(domain: int) -> str:
    return (
        f"waiting for your node {CONTROLLER!r}; it joins with ROS_DOMAIN_ID={domain} "
        "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST and --ros-args --remap __node:=controller"
    )


def _replaces(options: Namespace) -> bool:
    """Whether an earlier run is to be replaced."""
    return bool(options.overwrite and options.output and (options.output / LOGS).is_dir())


def _check_output(options: Namespace) -> None:
    """Raise ConfigurationError if the output folder will not be free or cannot be made."""
    wanted: Path | None = options.output
    if wanted is None or _replaces(options):
        return
    if wanted.exists():
        raise _taken(wanted)
    above = next(parent for parent in wanted.absolute().parents if parent.exists())
    if not above.is_dir():
        raise ConfigurationError(f"output folder {wanted} cannot be made: {above} is a file")


def _taken(folder: Path) -> ConfigurationError:
    return ConfigurationError(
        f"output folder {folder} exists; choose another, or --overwrite one that a run has made"
    )


@contextmanager
def _output_folder(options: Namespace, scenario: Scenario) -> Iterator[tuple[Path, int]]:
    """Make the output folder, and yield its full path and the file descriptor that locks it.

    Raises ConfigurationError if it cannot be made, and if a run that is to be replaced still goes on.
    """
    external = scenario.parameters.common.external
    law = OWN if CONTROLLER in external else scenario.parameters.controller.law
    wanted: Path = options.output or Path("runs") / f"{law}_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    names = (wanted,) if options.output else (wanted, *(Path(f"{wanted}_{n}") for n in range(2, _AT_ONCE)))
    try:
        wanted.parent.mkdir(parents=True, exist_ok=True)
        folder = next(name for name in names if _makes(name))
        (folder / LOGS).mkdir()
    except StopIteration:
        raise _taken(wanted) from None
    except OSError as error:
        raise ConfigurationError(f"output folder {wanted} cannot be made: {error.strerror}") from error
    with locked_logs(folder) as lock:
        yield folder.resolve(), lock


@contextmanager
def _earlier_run_aside(folder: Path) -> Iterator[None]:
    """Keep what an earlier run has left in a folder until the new run has come to its bag."""
    place = folder.resolve()
    aside = place.with_name(f".{place.name}_before_{os.getpid()}")
    try:
        with locked_logs(folder):
            place.rename(aside)
    except OSError as error:
        raise ConfigurationError(f"output folder {folder} cannot be replaced: {error.strerror}") from error
    try:
        yield
    except BaseException:
        if not (place / BAG).exists():  # ROS had not started
            shutil.rmtree(place, ignore_errors=True)
            aside.rename(place)
        raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _makes(folder: Path) -> bool:
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    return True
