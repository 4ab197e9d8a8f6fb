"""Any value of robot, deputy and schedule is set by its path, checked as if the file said so."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from sms_handover.configuration.values import with_values
from sms_handover.configuration.yaml_reader import load
from sms_handover.errors import ConfigurationError
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.trajectory.load import load_schedule


def test_values_are_those_of_the_scenario(tmp_path: Path, scenario: Scenario) -> None:
    """Also where an alias shares them or the file has none; the record has the schedule as it was run."""
    changed = load_scenario(
        "colliding",
        {
            "robot": {
                "base.mass": 300,
                "arms.arm_a.gripper.mass": 0.9,
                "arms.arm_b.limits.joint_2.effort": 20.0,
                "base.panels[1].size[0]": 0.5,
            },
            "deputy": {"size": [0.2, 0.4, 0.2]},
            "schedule": {"phases.withdraw.duration": 30.0, "phases.carry.gains": None},
            "controller": {"rolling_period": 0.5},
        },
    )
    arm_a, arm_b = changed.truth.robot.description.arms
    before = scenario.truth.robot.description
    assert changed.truth.robot.description.base.inertia.mass == 300.0
    assert (arm_a.gripper.mass, arm_b.gripper.mass) == (0.9, before.arms[1].gripper.mass)
    assert [joint.effort for joint in arm_b.joints][:3] == [39.0, 20.0, 39.0]
    assert changed.truth.robot.description.base.panels[1].size == (0.5, *before.base.panels[1].size[1:])
    assert changed.truth.robot.description.base.panels[0] == before.base.panels[0]
    np.testing.assert_array_equal(changed.truth.schedule.deputy.size, [0.2, 0.4, 0.2])
    assert changed.truth.schedule.end_ns == scenario.truth.schedule.end_ns + 10_000_000_000
    assert (dict(changed.truth.schedule.phases[1].gains), changed.parameters.controller.rolling_period) == (
        {},
        0.5,
    )
    path = tmp_path / "schedule.yaml"
    path.write_text(changed.truth.schedule.text, encoding="utf-8")
    recorded = load_schedule(path, changed.truth.robot, changed.parameters.common.reference_ns)
    assert (
        recorded.text == changed.truth.schedule.text
        and yaml.safe_load(recorded.text)["deputy"]["size"][1] == 0.4
    )


REFUSED: dict[str, tuple[Overrides, str]] = {
    "slip": (
        {"robot": {"base.mas": 3}},
        r"unknown path 'robot.base.mas' \(did you mean 'robot.base.mass'\?\)",
    ),
    "slip above": (
        {"robot": {"bas.mass": 3}},
        r"unknown path 'robot.bas.mass' \(did you mean 'robot.base.mass'\?\)",
    ),
    "slips in a path that is not set yet": (
        {"truth": {"robot.arms.arm_b.limit.joint_2.efort": 3}},
        r"unknown path 'truth.robot.arms.arm_b.limit.joint_2.efort' "
        r"\(did you mean 'truth.robot.arms.arm_b.limits.joint_2.effort'\?\): known are those of "
        "'sms-handover list paths'",
    ),
    "steps left out": (
        {"robot": {"gripper.mass": 3}},
        r"unknown path 'robot.gripper.mass' \(did you mean 'robot.arms.arm_.\.gripper.mass'\?\)",
    ),
    "slip in what is removed": (
        {"deputy": {"grasp_frame": None}},
        r"unknown path 'deputy.grasp_frame' \(did you mean 'deputy.grasp_frames'\?\)",
    ),
    "name": (
        {"schedule": {"phases.cary.duration": 3}},
        r"schedule.phases.cary.duration:=3: unknown name 'cary' \(did you mean 'carry'\?\)",
    ),
    "index": ({"robot": {"base.panels[2].size": 3}}, "unknown name '2': known are '0', '1'"),
    "below a number": ({"robot": {"base.mass.x": 3}}, "robot.base.mass.x:=3: 240.0 has no 'x'"),
    "range": ({"robot": {"base.mass": -1}}, "robot.base.mass:=-1: base.mass is -1 kg, must be > 0 kg"),
    "type": ({"deputy": {"size": "big"}}, "deputy.size:=.big.: deputy.size is 'big', must be 3 numbers in m"),
    "item": (
        {"robot": {"base.size[1]": 0}},
        r"robot.base.size\[1\]:=0: base.size\[1\] is 0 m, must be > 0 m",
    ),
    "missing": ({"robot": {"base.mass": None}}, r"robot.yaml:\d+: base.mass is missing"),
    "no path": ({"robot": {"": 3}}, "value 'robot.:=3' must be of the form PATH:=VALUE"),
    "document": ({"robt": {"base.mass": 3}}, r"unknown node 'robt' \(did you mean 'robot'\?\)"),
}


@pytest.mark.parametrize(("overrides", "words"), REFUSED.values(), ids=list(REFUSED))
def test_what_is_wrong_is_said_at_its_path(overrides: Overrides, words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_scenario("colliding", overrides)
    assert re.search(words, str(caught.value))
    assert "\n" not in str(caught.value)


def test_a_document_is_not_changed_in_place() -> None:
    """Nor is what an alias shares."""
    text = "a: &x {b: [{name: n, c: 1}]}\nd: *x\n"
    document = load(text)
    changed = with_values(document, "robot", ["robot.a.b.n.c:=2", "schedule.a:=5"])
    assert changed == {"a": {"b": [{"name": "n", "c": 2}]}, "d": {"b": [{"name": "n", "c": 1}]}}
    assert document == load(text)
