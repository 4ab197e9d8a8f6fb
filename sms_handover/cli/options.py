"""Options that several commands share, and the scenario that they describe."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sms_handover.bag.parameters import RecorderParameters
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import build, read_parameter_files
from sms_handover.configuration.scenario_file import COMMON, SHORT
from sms_handover.configuration.yaml_reader import load_value
from sms_handover.control.registry import require_law
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.graph.topics import CONTROLLER, RECORDER, TRAJECTORY
from sms_handover.simulation.parameters import DYNAMICS, MODES
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.trajectory.time_law import TIME_LAWS

Overrides = dict[str, dict[str, object]]


def add_scenario_options(parser: ArgumentParser) -> None:
    """Add the options that choose robot, schedule, controller and parameters."""
    group = parser.add_argument_group("scenario")
    group.add_argument(
        "scenario",
        nargs="?",
        metavar="SCENARIO",
        help="name of a shipped scenario ('sms-handover list'), or a scenario file (default: smooth); "
        "what the options say lies over it",
    )
    group.add_argument(
        "--controller",
        type=_law,
        metavar="LAW",
        help="control law: nmpc, pid, mpc, or one of another package (default: that of the scenario)",
    )
    group.add_argument(
        "--schedule", type=Path, metavar="FILE", help="task schedule (default: that of the scenario)"
    )
    group.add_argument(
        "--robot", type=Path, metavar="FILE", help="robot description (default: that of the scenario)"
    )
    group.add_argument(
        "--conditions",
        type=Path,
        metavar="CONDITIONS",
        help="what is not ideal: name of shipped conditions ('sms-handover list conditions'), or a file "
        "(default: those of the scenario, ideal unless it says so)",
    )
    group.add_argument(
        "--duration", type=float, metavar="S", help="simulated time in s (default: the schedule's)"
    )
    group.add_argument(
        "--time-law", choices=tuple(TIME_LAWS), help="approach of targets (default: that of the scenario)"
    )
    group.add_argument(
        "--dynamics",
        choices=DYNAMICS,
        help="compiled: the equations of motion as C code, made once, several times faster; needs CasADi and "
        "a C compiler (default: pinocchio)",
    )
    group.add_argument(
        "--params-file",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="parameters in ROS 2 form on top of the shipped ones; may be given again",
    )
    group.add_argument(
        "-p",
        "--param",
        action="append",
        default=[],
        metavar="PATH:=VALUE",
        help="one parameter, e.g. plant.integrator:=midpoint, where the node 'common' is for all of "
        "them; or a value of robot, deputy, schedule or conditions, e.g. robot.arms.arm_a.gripper.mass:=0.9, "
        "with truth before it for the plant alone, with model for all others: truth.robot.base.mass:=264",
    )


def _law(name: str) -> str:
    """Return the name of a control law; raises ArgumentTypeError."""
    try:
        require_law(name)
    except UnknownNameError as error:
        raise ArgumentTypeError(str(error)) from error
    return name


def overrides_of(options: Namespace) -> Overrides:
    """Return the parameters that the options set, by node; raises ConfigurationError."""
    overrides: Overrides = {}
    for text in options.param:
        node, name, value = _parse(text)
        overrides.setdefault(node, {})[name] = value
    shortcuts = (
        (COMMON, "scenario", options.scenario and str(_found(Path(options.scenario)))),
        (CONTROLLER, "law", options.controller),
        (TRAJECTORY, "time_law", options.time_law),
        (COMMON, "schedule", options.schedule and str(_found(options.schedule))),
        (COMMON, "robot", options.robot and str(_found(options.robot))),
        (COMMON, "conditions", options.conditions and str(_found(options.conditions))),
        (COMMON, "duration", options.duration),
        (COMMON, "dynamics", options.dynamics),
    )
    for node, name, value in shortcuts:
        if value is not None:
            overrides.setdefault(node, {})[name] = value
    return overrides


def scenario_of(
    options: Namespace, mode: str = MODES[0], *, recorded: bool = False, external: Sequence[str] = ()
) -> Scenario:
    """Return the scenario that the options describe, read and checked; raises ConfigurationError.

    If it is to be ``recorded``, the options may hold parameters of the recorder too. Those of
    ``external`` nodes are passed on as they are.
    """
    overrides = overrides_of(options)
    overrides.setdefault(COMMON, {}).setdefault("mode", mode)
    if external:
        overrides[COMMON]["external"] = list(external)
    of_recorder = overrides.pop(RECORDER, {}) if recorded else {}
    files = [_found(path) for path in options.params_file]
    scenario = load_scenario(values=overrides, files=files)
    if not recorded:
        return scenario
    values = read_parameter_files([config_file("recorder.yaml"), *files], RECORDER)
    build(RecorderParameters, {**values, **of_recorder}, RECORDER)
    return replace(scenario, overrides={**scenario.overrides, RECORDER: of_recorder})


def _parse(text: str) -> tuple[str, str, object]:
    """Return node, name and value of ``node.name:=value``."""
    target, assigned, value = text.partition(":=")
    node, dot, name = (SHORT[target], ".", target) if target in SHORT else target.partition(".")
    if not (assigned and dot and node and name):
        raise ConfigurationError(f"parameter {text!r} is not of the form NODE.NAME:=VALUE")
    return node, name, load_value(value, text)


def _found(path: Path) -> Path:
    """Return a file as every working directory finds it; anything else as written, for the error to name."""
    return path.resolve() if path.is_file() else path
