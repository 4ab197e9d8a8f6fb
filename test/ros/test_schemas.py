"""The schemas for editors accept what the readers accept, and reject most of what they reject."""

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from shutil import copy
from typing import Any

import pytest
import yaml
from jsonschema import Draft7Validator

from docs.reference import SCHEMAS, pages
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import build, read_parameter_files
from sms_handover.configuration.robot_fields import ARM_FIELDS
from sms_handover.configuration.sections import Section
from sms_handover.configuration.yaml_reader import Mapping, load, read_yaml
from sms_handover.errors import RobotDescriptionError, SmsHandoverError
from sms_handover.graph.topics import CONTROLLER
from sms_handover.model.arm_file import read_arm as arm_of
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.reference.interfaces import OWN_GROUPS
from sms_handover.simulation.scenario import load_parameters, load_scenario
from sms_handover.trajectory.load import load_schedule

from ..core.conftest import SCHEDULE

CONFIG = config_file("")
MODELINE = "# yaml-language-server: $schema="
SAMPLE = 30  # changed documents of each kind
CAUGHT = 0.75  # [-] least share of what the reader rejects that the schema rejects too
_WRONG: tuple[Any, ...] = (None, True, -1, 0, 3, 0.5, 1e9, "", "wrong", "hold", [], [1.0, 2.0, 3.0], {})

SCENARIOS = (
    """
    extends: paper
    description: mine
    robot:
      base: {mass: 300, panels: null}
      arms: {arm_b: {gripper: {mass: 0.9}, limits: {joint_2: {effort: 20}}}}
    schedule:
      phases: [{name: carry, duration: 30}, {name: rest, duration: 5, arms: {arm_a: hold, arm_b: hold}}]
    deputy: {size: [0.2, 0.4, 0.2]}
    """,
    """
    extends: paper
    law: pid
    seed: 3
    plant: {integrator: rk4}
    controller: {proportional: 3}
    truth: {robot: {base: {mass: 264.0}}, deputy: {grasp_frames: {end_a: {xyz: [0.0, 0.1, 0.0]}}}}
    model: {robot: {arms: [{name: arm_a, mount: {rpy: [0.0, 1.57, 0.0]}}]}}
    """,
)


@cache
def robot() -> RobotModel:
    return RobotModel.load()


def read_robot(path: Path) -> None:
    copy(config_file("gen3.yaml"), path.parent)
    load_robot(path)


def read_arm(path: Path) -> None:
    arm_of(Section.read(path, RobotDescriptionError, ARM_FIELDS), "arm_a")


def read_schedule(path: Path) -> None:
    load_schedule(path, robot(), 20_000_000)


def read_scenario(path: Path) -> None:
    load_scenario(path)


def read_parameters(path: Path) -> None:
    load_parameters(files=[path])
    for node, group in OWN_GROUPS.items():
        if node != CONTROLLER:
            values = read_parameter_files([config_file(group.file), path], node)
            build(group.cls, values, node)


@dataclass(frozen=True)
class Kind:
    """A kind of file: its reader, and good content to change."""

    read: Callable[[Path], None]
    good: tuple[Any, ...]


def parameters() -> Mapping:
    """Return the content of all shipped parameter files as one."""
    merged = Mapping()
    for file in sorted(CONFIG.glob("*.yaml")):
        content = read_yaml(file)
        if all(isinstance(value, Mapping) and "ros__parameters" in value for value in content.values()):
            merged.update(content)
    merged["player"]["ros__parameters"]["bag"] = "must be given"
    return merged


def one_arm() -> Mapping:
    """Return the content of robot.yaml without its second arm, which would be read from its file again."""
    content = read_yaml(config_file("robot.yaml"))
    del content["arms"][1:]
    return content


def schedules() -> Iterator[str]:
    """Yield a schedule with every kind of target and event, and each thing to do about a miss."""
    for word in ("continue", "abort", "{retry: 2}"):
        yield SCHEDULE.replace("  - name: carry\n", f"  - name: carry\n    on_miss: {word}\n")


KINDS = {
    "robot": Kind(read_robot, (one_arm(),)),
    "arm": Kind(read_arm, (read_yaml(config_file("gen3.yaml")),)),
    "schedule": Kind(read_schedule, (read_yaml(config_file("handover.yaml")), *map(load, schedules()))),
    "parameters": Kind(read_parameters, (parameters(),)),
    "scenario": Kind(read_scenario, tuple(map(load, SCENARIOS))),
}


@cache
def validator(kind: str) -> Draft7Validator:
    schema = json.loads(pages()[SCHEMAS / f"{kind}.schema.json"])
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


def places(node: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each container with each of its keys or indices."""
    keys = node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in list(keys):
        yield node, key
        yield from places(node[key])


def changed(document: Any, random: Random) -> Any:
    """Return a document with one value replaced, removed, renamed or taken from elsewhere."""
    document = deepcopy(document)
    container, key = random.choice(list(places(document)))
    change = random.randrange(5)
    if change == 0:
        del container[key]
    elif change == 1 and isinstance(container, dict):
        container[f"{key}s"] = container.pop(key)
    elif change == 2:
        other, place = random.choice(list(places(document)))
        container[key] = deepcopy(other[place])
    else:
        container[key] = random.choice(_WRONG)
    return document


def accepted(read: Callable[[Path], None], document: Any, folder: Path) -> bool:
    path = folder / "file.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    try:
        read(path)
    except SmsHandoverError:
        return False
    return True


@pytest.mark.parametrize("kind", KINDS)
def test_a_schema_is_never_stricter_than_the_reader(kind: str, tmp_path: Path) -> None:
    """What the reader accepts is valid; the schema may be laxer, where several keys must agree."""
    random, (read, good) = Random(14), (KINDS[kind].read, KINDS[kind].good)
    documents = [*good, *(changed(good[number % len(good)], random) for number in range(SAMPLE))]
    rejected = caught = 0
    for document in documents:
        errors = [error.message for error in validator(kind).iter_errors(document)]
        if accepted(read, document, tmp_path):
            assert not errors, (errors, document)
        else:
            assert all(document is not item for item in good)
            rejected, caught = rejected + 1, caught + bool(errors)
    print(kind, rejected, caught)
    assert rejected > SAMPLE / 3
    assert caught >= CAUGHT * rejected


_KINDS = {"scenarios": "scenario", "conditions": "conditions", "campaigns": "campaign"}  # by folder
_OURS = [path for path in sorted(CONFIG.rglob("*.yaml")) if path.parent.name != "diagnostics"]  # of others


@pytest.mark.parametrize("path", _OURS, ids=lambda path: path.name)
def test_a_shipped_file_is_valid_and_names_its_schema(path: Path) -> None:
    content = read_yaml(path)
    kind = _KINDS.get(path.parent.name) or kind_of(content)
    assert not list(validator(kind).iter_errors(content))
    first = path.read_text(encoding="utf-8").splitlines()[0]
    if first.startswith(MODELINE):
        assert (path.parent / first.removeprefix(MODELINE)).resolve() == SCHEMAS / f"{kind}.schema.json"
    else:
        assert kind in ("scenario", "schedule")  # whose first line says what the task is


def kind_of(content: Mapping) -> str:
    """Return which file has a key that no other has."""
    keys = {"arms": "robot", "flange": "arm", "phases": "schedule"}
    return next((kind for key, kind in keys.items() if key in content), "parameters")
