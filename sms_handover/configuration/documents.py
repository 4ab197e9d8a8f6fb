"""Documents of a run: the content of robot, schedule and conditions, as they are or as they are known."""

from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from sms_handover.configuration.conditions_content import read_conditions_content
from sms_handover.configuration.merge import merged
from sms_handover.configuration.robot_content import read_robot_content, with_arm_descriptions
from sms_handover.configuration.scenario_file import DESCRIPTION, ScenarioFile
from sms_handover.configuration.value_paths import require_known
from sms_handover.configuration.values import (
    CONDITIONS,
    DEPUTY,
    ROBOT,
    ROLES,
    SCHEDULE,
    roles_of,
    with_values,
)
from sms_handover.configuration.yaml_reader import Mapping, load_mapping, read_file

_ARMS, _ROTOR = "arms", "rotor_inertia"
_WIDTH = 110  # [characters] of a line


@dataclass(frozen=True, eq=False)
class Documents:
    """The content of robot, schedule and conditions, and the text of the schedule for the record."""

    robot: Mapping
    schedule: Mapping
    schedule_text: str
    conditions: Mapping


@dataclass(frozen=True)
class Replacements:
    """What replaces the documents of a scenario: files, '' for none, and values by dotted path."""

    robot: str = ""
    schedule: str = ""
    conditions: str = ""
    values: tuple[str, ...] = ()


def truth_is_model(scenario: ScenarioFile, given: Replacements) -> bool:
    """Whether the plant has the robot and deputy that every other node has."""
    return not any((scenario.truth, scenario.model, *roles_of(given.values)))


def documents_of(scenario: ScenarioFile, given: Replacements, role: str) -> Documents:
    """Return the documents of a scenario for a role, ``truth`` or ``model``; raises ConfigurationError.

    First what holds for everybody: a file given in place of that of the scenario, then values; then what is
    for this role alone: that of the scenario, then values.
    """
    both = _for_everybody(scenario, given)
    robot, schedule = with_rotors(both.robot, both.conditions), both.schedule
    own = scenario.of_role(role)
    if ROBOT in own:
        robot = merged(robot, own[ROBOT], own[ROBOT].file)
    if DEPUTY in own:
        changes = Mapping()
        changes[DEPUTY] = own[DEPUTY]
        schedule = merged(schedule, changes, own[DEPUTY].file)
    robot = with_values(robot, ROBOT, given.values, role)
    schedule = with_values(schedule, SCHEDULE, given.values, role)
    text = both.schedule_text if schedule is both.schedule else as_yaml(schedule)
    robot = with_arm_descriptions(robot, _folder(robot))
    return Documents(robot, schedule, text, both.conditions)


def resolved(scenario: ScenarioFile, given: Replacements) -> dict[str, object]:
    """Return a scenario as one that extends nothing, without parameters, and without values of roles.

    These, ``truth.…`` and ``model.…``, are still to be given.
    """
    both = _for_everybody(scenario, given)
    tree: dict[str, object] = {DESCRIPTION: scenario.description} if scenario.description else {}
    tree |= {ROBOT: with_arm_descriptions(both.robot, _folder(both.robot)), SCHEDULE: both.schedule}
    tree |= {CONDITIONS: both.conditions} if both.conditions else {}
    return tree | {role: scenario.of_role(role) for role in ROLES if scenario.of_role(role)}


def _for_everybody(scenario: ScenarioFile, given: Replacements) -> Documents:
    """Return the documents without what is for one role alone."""
    robot, schedule, text = scenario.robot, scenario.schedule, scenario.schedule_text
    if given.robot:
        robot = read_robot_content(Path(given.robot))
    if given.schedule:
        path = Path(given.schedule)
        text = read_file(path)
        schedule = load_mapping(text, path)
    conditions = scenario.conditions
    if given.conditions:
        conditions = read_conditions_content(Path(given.conditions))
    for document, content in ((ROBOT, robot), (SCHEDULE, schedule), (CONDITIONS, conditions)):
        require_known(given.values, document, content)
    conditions = with_values(conditions, CONDITIONS, given.values)
    changed = with_values(schedule, SCHEDULE, given.values)
    if changed is not schedule or not text:
        text = as_yaml(changed)
    return Documents(with_values(robot, ROBOT, given.values), changed, text, conditions)


def with_rotors(robot: Mapping, conditions: Mapping) -> Mapping:
    """Return the content of a robot with the inertia of rotors that conditions give to its joints.

    One number is for all joints, a list is in their order. Anything that is not as a robot has it is left to
    the reader of robots, and so is a list that is too long: the last arm gets the rest.
    """
    given, arms = conditions.get(_ROTOR), robot.get(_ARMS)
    if given is None or not isinstance(arms, list):
        return robot
    result, changed, first = copy(robot), [], 0
    for arm in arms:
        old = arm.get(_ROTOR) if isinstance(arm, Mapping) else None
        count = len(old) if isinstance(old, list) else 0
        rotors = given[first : first + count] if isinstance(given, list) else [given] * count
        first += count
        changed.append(copy(arm))
        if count:
            changed[-1][_ROTOR] = rotors
            changed[-1].origins = {**arm.origins, _ROTOR: f"{CONDITIONS}.{_ROTOR}"}
    if isinstance(given, list) and 0 < first < len(given) and isinstance(changed[-1].get(_ROTOR), list):
        changed[-1][_ROTOR] = [*changed[-1][_ROTOR], *given[first:]]
    result[_ARMS] = changed
    return result


def _folder(content: Mapping) -> Path:
    """Return the folder that paths in a document are relative to."""
    return content.file.parent if content.file else Path()


class _WithoutAliases(yaml.SafeDumper):
    """Writes what is shared out in full, so that each place can be changed alone."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def as_yaml(content: object) -> str:
    """Return content as YAML that reads back as the same numbers."""
    style: dict[str, Any] = {
        "sort_keys": False,
        "allow_unicode": True,
        "default_flow_style": None,
        "width": _WIDTH,
    }
    text: str = yaml.dump(content, Dumper=_WithoutAliases, **style)
    return text
