"""A scenario: parameters of a run, and its robot and schedule as they are and as they are known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TypeVar

from sms_handover.conditions.conditions import IDEAL, Conditions, conditions_of, model_error_of
from sms_handover.conditions.model_error import ModelError, with_model_error
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.configuration.documents import Replacements, as_yaml, documents_of, resolved, truth_is_model
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import EVERY_NODE, build, read_parameter_files
from sms_handover.configuration.scenario_file import COMMON, SHORT, ScenarioFile, load_scenario_file
from sms_handover.configuration.sections import Section
from sms_handover.configuration.values import DEPUTY, DOCUMENTS, MODEL, ROLES, TRUTH, written
from sms_handover.control.parameters import ControllerParameters, parameters_with
from sms_handover.control.registry import law_named
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.graph.topics import CONTROLLER, IK, NODES, PLANT, PLAYER, TOPIC_RECORDER, TRAJECTORY, VIEWER
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.description import robot_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.parameters import PlantParameters
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.trajectory.load import schedule_of
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.trajectory.schedule import Schedule

T = TypeVar("T")

_SECTIONS = (EVERY_NODE, *NODES, PLAYER, TOPIC_RECORDER, VIEWER)  # of parameter files
_SLIP = 0.8  # [-] similarity of names, by difflib, from which one is a misspelling


Overrides = Mapping[str, Mapping[str, object]]  # by node, or by document and path


@dataclass(frozen=True)
class ParameterSet:
    """Parameters of the nodes of the loop."""

    common: CommonParameters
    plant: PlantParameters
    trajectory: TrajectoryParameters
    ik: IkParameters
    controller: ControllerParameters


@dataclass(frozen=True, eq=False)
class World:
    """Robot and schedule, the deputy in it, and conditions, as they are or as they are known.

    What is known of the conditions is that they are ideal. ``model_error`` is what the robot was drawn with.
    """

    robot: RobotModel
    schedule: Schedule
    conditions: Conditions = IDEAL
    model_error: ModelError | None = None


@dataclass(frozen=True, eq=False)
class Scenario:
    """Parameters of one run, and its world: the ``truth`` that the plant has, the ``model`` of all others.

    Unless the scenario makes a difference between them, the two are the same object, or have robot and
    schedule in common where the conditions are not ideal.
    """

    parameters: ParameterSet
    truth: World
    model: World
    overrides: Overrides = field(default_factory=dict)

    @property
    def end_ns(self) -> int:
        """When the last phase ends, in ns of simulation time."""
        return self.model.schedule.end_ns


def load_parameters(
    overrides: Overrides | None = None, files: Sequence[Path] = (), scenario: ScenarioFile | None = None
) -> ParameterSet:
    """Return the default parameters, overridden by a scenario, by ``files`` and then by ``overrides``.

    ``overrides`` maps a node name, or ``common``, to parameters. Raises ConfigurationError.
    """
    overrides = overrides or {}
    known = (COMMON, PLANT, TRAJECTORY, IK, CONTROLLER)
    for node in overrides:
        if node not in known:
            raise UnknownNameError("node", node, (*known, *DOCUMENTS, *ROLES), "parameter overrides")

    for path in files:
        _reject_misspelt(path)

    def given(node: str, section: str) -> tuple[dict[str, object], dict[str, str]]:
        values, over = read_parameter_files([config_file(f"{node}.yaml")], section), overrides.get(node, {})
        for more in (scenario and scenario.parameters[node], read_parameter_files(files, section)):
            if more:
                values.update(more)
                values.places.update(more.places)
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
        controller = build(parameters_with(law, CommonParameters), values, CONTROLLER, places)
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


def load_scenario(
    name: str | Path = "", values: Mapping[str, object] | None = None, files: Sequence[Path] = ()
) -> Scenario:
    """Return a shipped scenario, or that in a file, by default the one of ``config/common.yaml``, checked.

    ``values`` are by dotted path, such as ``{"law": "pid", "robot.base.mass": 300}``, where a common
    beginning may be a key of its own: ``{"controller": {"law": "pid"}}``. ``files`` are parameters in ROS 2
    form. Both lie over the scenario, the values on top. Raises ConfigurationError.
    """
    of_nodes = _by_node(values or {})
    if name:
        of_nodes.setdefault(COMMON, {})["scenario"] = str(name)
    texts = [text for first in (*DOCUMENTS, *ROLES) for text in written(first, of_nodes.pop(first, {}))]
    if texts:
        of_nodes.setdefault(COMMON, {})["values"] = texts
    scenario = load_scenario_file(_scenario_name(of_nodes, files))
    parameters = load_parameters(of_nodes, files, scenario)
    truth = load_world(parameters.common, TRUTH, scenario)
    if truth_is_model(scenario, _replacements(parameters.common)) and not truth.model_error:
        model = truth if truth.conditions is IDEAL else replace(truth, conditions=IDEAL)
    else:
        model = load_world(parameters.common, MODEL, scenario)
    if model.robot.joint_names != truth.robot.joint_names:
        raise ConfigurationError(
            f"truth has the joints {', '.join(truth.robot.joint_names)}, "
            f"the model has {', '.join(model.robot.joint_names)}: they must be the same"
        )
    masses = (truth.schedule.deputy.mass, model.schedule.deputy.mass)
    parameters = replace(parameters, common=parameters.common.for_deputies(*masses))
    return Scenario(parameters, truth, model, of_nodes)


def load_world(common: CommonParameters, role: str, scenario: ScenarioFile) -> World:
    """Return robot and schedule of a scenario for a role, ``truth`` or ``model``.

    What the parameters give in place of its files and values lies over it. Raises ConfigurationError.
    """
    documents = documents_of(scenario, _replacements(common), role)
    description, text = robot_of(documents.robot), documents.schedule_text
    error = model_error_of(documents.conditions) if role == TRUTH else None
    if error:
        description = with_model_error(description, error, RandomStreams(common.seed))
    robot = RobotModel(description)
    conditions = conditions_of(documents.conditions, robot)
    schedule = schedule_of(documents.schedule, text, robot, common.reference_ns)
    if role == TRUTH:
        _check_wrenches(conditions, schedule)
    return World(robot, schedule, conditions if role == TRUTH else IDEAL, error)


def _check_wrenches(conditions: Conditions, schedule: Schedule) -> None:
    """Raise ConfigurationError where a wrench acts on a deputy without mass, which nothing can move."""
    for name in conditions.deputy_wrenches:
        if not schedule.deputy.mass:
            raise ConfigurationError(
                f"conditions.wrenches.{name} acts on the deputy, whose mass is 0 kg, must be > 0 kg: "
                "set deputy.mass, or let the wrench act on the base"
            )


def deputy_masses(
    common: CommonParameters, scenario: ScenarioFile, role: str, world: World
) -> tuple[float, ...]:
    """Return the masses in kg of the deputy of a role and of the other; raises ConfigurationError.

    ``world`` is that of the role; the other's documents are read only where they differ.
    """
    given, own = _replacements(common), world.schedule.deputy.mass
    if truth_is_model(scenario, given):
        return (own,)
    other = MODEL if role == TRUTH else TRUTH
    return own, float(documents_of(scenario, given, other).schedule[DEPUTY]["mass"])


def scenario_text(common: CommonParameters, scenario: ScenarioFile) -> str:
    """Return a scenario, with what the parameters give, as YAML that needs no other file, for the record."""
    return as_yaml(resolved(scenario, _replacements(common)))


def _replacements(common: CommonParameters) -> Replacements:
    return Replacements(common.robot, common.schedule, common.conditions, common.values)


def _scenario_name(of_nodes: Overrides, files: Sequence[Path]) -> str:
    """Return the scenario that parameters name."""
    paths = [config_file("common.yaml"), *files]
    given = {**read_parameter_files(paths, EVERY_NODE), **of_nodes.get(COMMON, {})}
    return str(given["scenario"])


def _by_node(values: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """Return values by the first step of their paths; raises ConfigurationError on one without any."""
    result: dict[str, dict[str, object]] = {}
    for path, value in values.items():
        first, dot, rest = path.partition(".")
        if first in SHORT and not dot:
            result.setdefault(SHORT[first], {})[first] = value
        elif dot:
            result.setdefault(first, {})[rest] = value
        elif isinstance(value, Mapping):
            result.setdefault(first, {}).update(value)
        else:
            raise ConfigurationError(f"value {path!r} must have a path with a dot, or be a mapping")
    return result
