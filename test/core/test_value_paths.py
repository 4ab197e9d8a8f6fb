"""Every value has a path, which says unit and range, and which sets that value."""

import re
from copy import deepcopy
from pathlib import Path

import pytest

from sms_handover.configuration.field_specification import EitherSpec, MappingSpec, Spec
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.schedule_fields import SCHEDULE_FIELDS
from sms_handover.configuration.value_paths import ValuePath, parameter_paths, value_paths
from sms_handover.configuration.values import DEPUTY, DOCUMENTS, ROBOT, SCHEDULE, with_values, written
from sms_handover.configuration.yaml_reader import Mapping, load, read_yaml
from sms_handover.control.parameters import ControllerParameters
from sms_handover.simulation.scenario import Scenario

from .conftest import SCHEDULE as ANOTHER

CONTENTS = {
    "robot": (ROBOT, read_yaml(config_file("robot.yaml"))),
    "schedule": (SCHEDULE, read_yaml(config_file("schedules/colliding.yaml"))),
    "schedule of every kind": (SCHEDULE, load(ANOTHER)),
}


def leaves(node: object) -> int:
    """Return how many values a document has; a list of numbers is one."""
    if isinstance(node, Mapping):
        return sum(map(leaves, node.values()))
    if isinstance(node, list) and any(isinstance(item, Mapping) for item in node):
        return sum(map(leaves, node))
    return node != []


def by_path(paths: tuple[ValuePath, ...]) -> dict[str, ValuePath]:
    found = {item.path: item for item in paths}
    assert len(found) == len(paths)
    return found


@pytest.mark.parametrize(("document", "content"), CONTENTS.values(), ids=list(CONTENTS))
def test_each_value_is_set_by_its_path(document: str, content: Mapping) -> None:
    """Each once: setting it to its present value changes nothing, and null removes this value alone."""
    found = by_path(value_paths(document, content))
    given = {path: item.value for path, item in found.items() if item.value is not None}
    assert len(given) == leaves(content)
    for path, value in given.items():
        first, rest = path.split(".", 1)
        assert first in DOCUMENTS
        assert with_values(content, document, written(first, {rest: value})) == content
        changed = with_values(content, document, written(first, {rest: None}))
        assert leaves(changed) == len(given) - 1


def test_what_a_path_says() -> None:
    """Named items by their names; unit, range and meaning; what may be given and is not has no value."""
    robot, schedule = (by_path(value_paths(*CONTENTS[name])) for name in (ROBOT, SCHEDULE))
    mass = robot["robot.arms.arm_a.gripper.mass"]
    assert mass == ValuePath(mass.path, 0.6451, "kg", "above 0", "mass")
    assert robot["robot.base.panels[1].size"].allowed == "3 numbers, above 0"
    assert robot["robot.base.inertia"].allowed == "uniform_box"
    duration = schedule["schedule.phases.carry.duration"]
    assert (duration.value, duration.unit, duration.allowed) == (20.0, "s", "at least 1e-09")
    assert schedule["deputy.size"].value == [0.1, 0.34, 0.1]
    assert schedule["schedule.phases.carry.on_miss"].value is None
    assert schedule["schedule.phases.carry.on_miss"].allowed == "continue | abort"
    assert not any(path.startswith(f"{SCHEDULE}.{DEPUTY}") for path in schedule)


def test_a_name_with_a_dot_is_replaced_by_its_index() -> None:
    content = deepcopy(CONTENTS[ROBOT][1])
    content["arms"][0]["name"] = "arm.a"
    assert "robot.arms[0].name" in by_path(value_paths(ROBOT, content))


def keys_of(spec: Spec) -> set[str]:
    """Return all keys that stand in mappings of a specification."""
    if isinstance(spec, MappingSpec):
        return {*spec.fields, *(key for inner in spec.fields.values() for key in keys_of(inner))}
    inner = spec.other if isinstance(spec, EitherSpec) else getattr(spec, "each", None)
    return keys_of(inner) if inner else set()


def test_the_page_of_the_schedule_has_every_key() -> None:
    page = Path(__file__).parents[2].joinpath("docs", "schedule.md").read_text(encoding="utf-8")
    assert [key for key in sorted(keys_of(SCHEDULE_FIELDS)) if not re.search(rf"\b{key}\b", page)] == []


def test_paths_of_parameters(scenario: Scenario) -> None:
    found = by_path(parameter_paths("controller", ControllerParameters, vars(scenario.parameters.controller)))
    period = found["controller.rolling_period"]
    assert (period.value, period.unit, period.allowed) == (1.0, "s", "at least 0.001")
