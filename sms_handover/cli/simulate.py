"""``sms-handover simulate``: the same run in one process, without ROS."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.comparison import compare
from sms_handover.analysis.table import render
from sms_handover.cli.collisions import warn_of_collisions
from sms_handover.cli.exit_codes import EXIT_FAILED
from sms_handover.cli.options import add_scenario_options, scenario_of
from sms_handover.cli.task_code import task_code
from sms_handover.errors import NoPlanError
from sms_handover.launcher.display import Display
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.save import save_run
from sms_handover.simulation.simulate import RunWithoutPlanError, simulate
from sms_handover.types import TaskPhase


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Run the handover in one process by plain calls, without DDS and without a bag. The numbers are the "
        "same, bit for bit, as those of a run over DDS in lock step."
    )
    parser.epilog = (
        "exit codes: 0 the task is done; 1 it failed, or bodies have collided and that was to be "
        "rejected; 2 wrong input; 4 a grasp missed and no retry mended it"
    )
    add_scenario_options(parser)
    parser.add_argument(
        "--reject-collisions", action="store_true", help="fail, with exit code 1, if bodies have collided"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE.npz", help="write the arrays of the run to a NumPy archive"
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    scenario = scenario_of(options)
    check_scenario(scenario)
    common = scenario.parameters.common
    with Display(common.last_tick(scenario.end_ns) * common.tick_ns) as display:

        def show(stamp_ns: int, phase: TaskPhase) -> None:
            display.lasts_until(common.last_tick(phase.end_ns, failed=phase.failed) * common.tick_ns)
            display.show_run(stamp_ns, phase.name)

        no_plan = ""
        try:
            run = simulate(scenario, progress=show)
        except RunWithoutPlanError as error:
            run, no_plan = error.run, str(error)
        display.show_run(int(run.tick_ns[-1]), run.phases[-1].name, last=True)
    name, tolerance = scenario.parameters.controller.law, scenario.parameters.plant.grasp_tolerance
    urdf, schedule = scenario.truth.robot.urdf, scenario.truth.schedule.text
    texts = TaskTexts(urdf, schedule, common.contact_depth)
    for event in run.run_events:
        print(event)
    comparison = compare({name: run}, texts={name: texts})
    print(render(comparison, tolerance))
    clearance = comparison.runs[name].clearance
    if clearance:
        warn_of_collisions(clearance)
    if options.output:
        save_run(run, options.output)
        print(f"arrays written to {options.output}")
    if no_plan:
        raise NoPlanError(f"{no_plan}; the figures are of the run up to there")
    if options.reject_collisions and clearance and clearance.collisions:
        return EXIT_FAILED
    return task_code(run.grasp_events, run.run_events, failed=run.phases[-1].failed)
