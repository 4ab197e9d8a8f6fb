"""``sms-handover simulate``: the same run in one process, without ROS."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.table import comparison_table
from sms_handover.cli.options import add_scenario_options, scenario_of
from sms_handover.cli.task_code import task_code
from sms_handover.launcher.display import Display
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.save import save_run
from sms_handover.simulation.simulate import simulate
from sms_handover.types import TaskPhase


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Run the handover in one process by plain calls, without DDS and without a bag. The numbers are the "
        "same, bit for bit, as those of a run over DDS in lock step."
    )
    parser.epilog = (
        "exit codes: 0 the task is done; 1 it failed; 2 wrong input; 4 a grasp missed and no retry mended it"
    )
    add_scenario_options(parser)
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

        run = simulate(scenario, progress=show)
        display.show_run(int(run.tick_ns[-1]), run.phases[-1].name, last=True)
    name, tolerance = scenario.parameters.controller.law, scenario.parameters.plant.grasp_tolerance
    texts = TaskTexts(scenario.truth.robot.urdf, scenario.truth.schedule.text)
    for event in run.run_events:
        print(event)
    print(comparison_table({name: run}, tolerance=tolerance, texts={name: texts}))
    if options.output:
        save_run(run, options.output)
        print(f"arrays written to {options.output}")
    return task_code(run.grasp_events, run.run_events, failed=run.phases[-1].failed)
