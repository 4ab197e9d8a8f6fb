"""A scenario: parameters, robot and schedule of a run, read from files and checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import TypeVar

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import EVERY_NODE, build, read_parameter_files
from sms_handover.configuration.sections import Section
from sms_handover.configuration.values import DOCUMENTS, written
from sms_handover.control.parameters import ControllerParameters, parameters_with
from sms_handover.control.registry import law_named
from sms_handover.errors import UnknownNameError
from sms_handover.graph.topics import CONTROLLER, IK, NODES, PLANT, PLAYER, TOPIC_RECORDER, TRAJECTORY, VIEWER
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.parameters import PlantParameters
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.trajectory.load import load_schedule
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.trajectory.schedule import Schedule

T = TypeVar("T")

_SECTIONS = (EVERY_NODE, *NODES, PLAYER, TOPIC_RECORDER, VIEWER)  # of parameter files
_SLIP = 0.8  # [-] similarity of names, by difflib, from which one is a misspelling

COMMON = "common"  # prefix of an override for every node

Overrides = Mapping[str, Mapping[str, object]]


@dataclass(frozen=True)
class ParameterSet:
    """Parameters of the nodes of the loop."""

    common: CommonParameters
    plant: PlantParameters
    trajectory: TrajectoryParameters
    ik: IkParameters
    controller: ControllerParameters


@dataclass(frozen=True, eq=False)
class Scenario:
    """Parameters, robot and schedule of one run."""

    parameters: ParameterSet
    robot: RobotModel
    schedule: Schedule
    overrides: Overrides = field(default_factory=dict)


def load_parameters(overrides: Overrides | None = None, files: Sequence[Path] = ()) -> ParameterSet:
    """Return the default parameters, overridden by ``files`` and then by ``overrides``.

    ``overrides`` maps a node name, or ``common``, to parameters. Raises ConfigurationError.
    """
    overrides = overrides or {}
    known = (COMMON, PLANT, TRAJECTORY, IK, CONTROLLER)
    for node in overrides:
        if node not in known:
            raise UnknownNameError("node", node, (*known, *DOCUMENTS), "parameter overrides")

    for path in files:
        _reject_misspelt(path)

    def given(node: str, section: str) -> tuple[dict[str, object], dict[str, str]]:
        values, over = (
            read_parameter_files([config_file(f"{node}.yaml"), *files], section),
            overrides.get(node, {}),
        )
        return {**values, **over}, {name: place for name, place in values.places.items() if name not in over}

    def group(cls: type[T], node: str, section: str) -> T:
        values, places = given(node, section)
        return build(cls, values, node, places)

    common = group(CommonParameters, COMMON, EVERY_NODE)
    if CONTROLLER in common.external:  # overrides are for a node that we do not know
        shipped = read_parameter_files([config_file("controller.yaml")], CONTROLLER)
        controller = build(ControllerParameters, shipped, CONTROLLER)
    else:
        values, places = given(CONTROLLER, CONTROLLER)
        law = law_named(str(values["law"]), f"{places.get('law', CONTROLLER)}: parameter 'law'")
        controller = build(parameters_with(law), values, CONTROLLER, places)
    return ParameterSet(
        common=common,
        plant=group(PlantParameters, PLANT, PLANT),
        trajectory=group(TrajectoryParameters, TRAJECTORY, TRAJECTORY),
        ik=group(IkParameters, IK, IK),
        controller=controller,
    )


def _reject_misspelt(path: Path) -> None:
    """Raise UnknownNameError on a section of a parameter file whose name resembles that of a node.

    A file may have sections for other nodes, so only what looks misspelt is rejected.
    """
    document = Section.read(path)
    for section in document.keys:
        if section not in _SECTIONS and get_close_matches(section, _SECTIONS, n=1, cutoff=_SLIP):
            raise UnknownNameError("node", section, _SECTIONS, document.where(section))


def load_scenario(overrides: Overrides | None = None, files: Sequence[Path] = ()) -> Scenario:
    """Return the scenario that parameters, robot description and schedule make, all checked.

    ``overrides`` maps ``robot``, ``deputy`` and ``schedule`` to values by dotted path too, such as
    ``{"robot": {"arms.arm_a.gripper.mass": 0.9}}``.
    """
    of_nodes = {node: dict(values) for node, values in (overrides or {}).items()}
    values = [text for document in DOCUMENTS for text in written(document, of_nodes.pop(document, {}))]
    if values:
        of_nodes.setdefault(COMMON, {})["values"] = values
    parameters = load_parameters(of_nodes, files)
    robot = load_robot_model(parameters.common)
    schedule = load_task(parameters.common, robot)
    return Scenario(parameters, robot, schedule, of_nodes)


def load_robot_model(common: CommonParameters) -> RobotModel:
    """Return the model of the robot that the parameters name."""
    return RobotModel.load(Path(common.robot) if common.robot else None, common.values)


def load_task(common: CommonParameters, robot: RobotModel) -> Schedule:
    """Return the schedule named by the parameters, checked against the robot."""
    path = Path(common.schedule) if common.schedule else config_file("handover.yaml")
    return load_schedule(path, robot, common.reference_ns, common.values)
