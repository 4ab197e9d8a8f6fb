"""Collisions of a scenario: what a command does about them, before a run or after it."""

import sys
from argparse import ArgumentParser, Namespace

from sms_handover.analysis.clearance import RunClearance
from sms_handover.graph.topics import CONTROLLER
from sms_handover.simulation.dry_run import dry_run
from sms_handover.simulation.scenario import Scenario
from sms_handover.terminal.progress import Progress
from sms_handover.types import Collision, TaskPhase
from sms_handover.units import ns_to_seconds

_AFTER_S = 1.0  # [s] of wall time from which on a dry run says what it is doing


def add_dry_run_options(parser: ArgumentParser) -> None:
    """Add the options on the dry run before a run."""
    group = parser.add_argument_group("collisions")
    choice = group.add_mutually_exclusive_group()
    choice.add_argument(
        "--reject-collisions",
        action="store_true",
        help="exit code 2, and nothing is started, if bodies collide in the dry run (default: warn of it)",
    )
    choice.add_argument(
        "--no-dry-run",
        action="store_true",
        help="do not simulate the run in one process first, to see whether bodies collide",
    )


def check_collisions(scenario: Scenario, options: Namespace) -> None:
    """Warn if bodies collide in a dry run; raises CollisionError if that is to be rejected.

    A scenario whose controller is external has no dry run.
    """
    common = scenario.parameters.common
    if options.no_dry_run or CONTROLLER in common.external:
        return
    with Progress(after_s=_AFTER_S) as progress:
        end_ns = common.last_tick(scenario.end_ns) * common.tick_ns

        def show(stamp_ns: int, phase: TaskPhase) -> None:
            if progress.due:
                done, whole = ns_to_seconds(stamp_ns), ns_to_seconds(end_ns)
                text = f"dry run {done:6.2f} of {whole:g} s  {phase.name}"
                progress.show(text, share=min(done / whole, 1.0) if whole else 1.0)

        found = dry_run(scenario, show)
    if options.reject_collisions:
        found.require_clear()
    if found.collisions:
        print(f"warning: in a dry run {found}", file=sys.stderr, flush=True)


def warn_of_collisions(clearance: RunClearance) -> None:
    """Print the worst collision of a run that is over, if there is one."""
    if clearance.collisions:
        worst = clearance.collisions[0]
        told = Collision(worst.stamp_ns, worst.group, worst.bodies, worst.least, worst.allowed)
        print(f"warning: bodies collide, at worst {told}", file=sys.stderr)
