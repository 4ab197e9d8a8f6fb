"""``sms-handover check``: whether a scenario can be run, and where each phase ends."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from enum import Enum
from math import degrees
from pathlib import Path

from sms_handover.campaign.definition.frozen import campaign_names, campaign_path
from sms_handover.campaign.engine.plan import plan_in_words
from sms_handover.cli.collisions import add_dry_run_options, check_collisions
from sms_handover.cli.columns import columns
from sms_handover.cli.options import add_scenario_options, scenario_of
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.configuration.sections import Section
from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.feasibility import PhasePrediction
from sms_handover.simulation.scenario import Scenario
from sms_handover.terminal.progress import Progress
from sms_handover.units import ns_to_seconds

_HEAD = ("phase", "ends [s]", "base rotation [deg]", "IK restarts")
_OVER_A_SCENARIO = (  # options
    *("controller", "conditions", "duration", "time_law", "dynamics", "params_file", "param"),
    *("reject_collisions", "no_dry_run"),
)


class _Kind(Enum):
    """What a file holds; the value is what a user reads."""

    SCENARIO = "scenario"
    SCHEDULE = "schedule"
    ROBOT = "robot"
    PARAMETERS = "parameters"
    CAMPAIGN = "campaign"


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Check whether a scenario can be run: every value, every target in reach, every grasp at its frame,\n"
        "the sampled loop stable where each phase ends; then by a dry run whether bodies collide. SCENARIO\n"
        "may also be a file with a schedule or with parameters, checked in the default scenario, with a\n"
        "robot, or with a campaign, or the name of a shipped one, whose first case is run."
    )
    parser.epilog = (
        "Where the targets of a phase were found only after restarts, the run may end elsewhere.\n\n"
        "examples:\n"
        "  sms-handover check paper -p robot.base.mass:=120\n"
        "  sms-handover check mine.yaml\n\n"
        "exit codes: 0 it can be run; 2 it cannot, or bodies collide and that is to be rejected"
    )
    add_scenario_options(parser)
    add_dry_run_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    name = options.scenario
    file = Path(name) if name else None
    if file and not file.exists() and name not in scenario_names() and name in campaign_names():
        file = campaign_path(name)
    kind = _kind_of(file) if file and file.exists() else _Kind.SCENARIO
    if file and kind is not _Kind.SCENARIO:
        options.scenario = None
    if file and kind is _Kind.ROBOT:
        if not options.schedule:
            return _check_robot(file, options)
        options.robot = file
    elif file and kind is _Kind.SCHEDULE:
        options.schedule = file
    elif file and kind is _Kind.PARAMETERS:
        options.params_file = [*options.params_file, file]
    elif file and kind is _Kind.CAMPAIGN:
        return _check_campaign(file, options)
    scenario = scenario_of(options, recorded=True)
    predictions = check_scenario(scenario)
    check_collisions(scenario, options)
    print(_ends(scenario, predictions))
    print(f"\n{_of_whom(scenario, kind, name)} can be run")
    return 0


def _kind_of(file: Path) -> _Kind:
    """Return what a file holds, by its keys; what is none of the others has to be a scenario."""
    if file.is_dir():
        raise ConfigurationError(f"{file} is a folder; 'sms-handover bag check {file}' checks a recording")
    root = Section.read(file)
    if any("ros__parameters" in value for value in map(root.value, root.keys) if isinstance(value, dict)):
        return _Kind.PARAMETERS
    if {"scenarios", "draws", "laws"} & set(root.keys):
        return _Kind.CAMPAIGN
    if {"phases", "initial"} & set(root.keys):
        return _Kind.SCHEDULE
    return _Kind.ROBOT if {"base", "arms"} & set(root.keys) else _Kind.SCENARIO


def _check_robot(file: Path, options: Namespace) -> int:
    """Check a robot by itself; return the exit code."""
    if _given(options, _OVER_A_SCENARIO):
        raise ConfigurationError(
            f"{file} is a robot, checked alone: give --schedule too, or a scenario and --robot {file}"
        )
    robot = RobotModel.load(file)
    arms = "; ".join(f"{arm} with {_count(robot, arm)} joints" for arm in robot.arms)
    print(f"robot {robot.description.name}: {robot.mass:.6g} kg; {arms}")
    print(f"\nrobot {file} is complete")
    return 0


def _check_campaign(file: Path, options: Namespace) -> int:
    """Check a campaign; return the exit code."""
    given = _given(options, (*_OVER_A_SCENARIO, "robot", "schedule"))
    if given:
        raise ConfigurationError(
            f"{file} is a campaign, which takes no options, given is {given[0]}: put values into the file"
        )
    with Progress() as progress:
        progress.show("running the first case of each scenario under each law")
        text = plan_in_words(file)
    print(f"{text}\n\ncampaign {file} can be run")
    return 0


def _given(options: Namespace, names: Sequence[str]) -> list[str]:
    """Return which of some options are given, 0 as any other number."""
    values = {f"--{name.replace('_', '-')}": getattr(options, name) for name in names}
    return [name for name, value in values.items() if not (value is None or value is False or value == [])]


def _count(robot: RobotModel, arm: str) -> int:
    joints = robot.arm_joints[arm]
    return int(joints.stop - joints.start)


def _ends(scenario: Scenario, predictions: Sequence[PhasePrediction]) -> str:
    """Return the table of where each phase ends."""
    rows = [
        (
            phase.name,
            f"{ns_to_seconds(phase.end_ns):g}",
            f"{degrees(end.base_rotation_angle):.3f}",
            str(end.restarts),
        )
        for phase, end in zip(scenario.model.schedule.phases, predictions, strict=True)
    ]
    return columns([_HEAD, *rows])


def _of_whom(scenario: Scenario, kind: _Kind, name: str | None) -> str:
    """Return what was checked, in words."""
    law, used = scenario.parameters.controller.law, scenario.parameters.common.scenario
    if kind is _Kind.SCENARIO:
        return f"scenario {name or used} under {law}"
    return f"scenario {used} under {law} with {kind.value} {name}"
