"""Scenario files: what extends what, how documents merge, and who has the truth and who the model."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from sms_handover.analysis.equality import compare_runs
from sms_handover.configuration.documents import Replacements, as_yaml, resolved
from sms_handover.configuration.merge import merged
from sms_handover.configuration.scenario_file import load_scenario_file, scenario_names
from sms_handover.configuration.yaml_reader import load_mapping
from sms_handover.errors import ConfigurationError
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.scenario import Scenario, load_scenario, scenario_text
from sms_handover.simulation.simulate import simulate

HEAVY = "extends: paper\ntruth: {robot: {base: {mass: 264.0}}}\ncommon: {duration: 0.3}\n"


def _file(folder: Path, text: str, name: str = "mine.yaml") -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", scenario_names())
def test_a_shipped_scenario_can_be_run_and_is_written_out_as_itself(name: str, tmp_path: Path) -> None:
    """What is written for the record names no other file, and reads back as the same robot and task."""
    scenario = load_scenario(name)
    check_scenario(scenario)
    assert load_scenario_file(name).description
    text = scenario_text(scenario.parameters.common, load_scenario_file(name))
    again = load_scenario(_file(tmp_path, text), {"common": {"duration": 1.0}})
    for one, other in ((scenario.truth, again.truth), (scenario.model, again.model)):
        assert one.robot.urdf == other.robot.urdf
        assert yaml.safe_load(one.schedule.text) == yaml.safe_load(other.schedule.text)


def test_a_scenario_says_what_differs(tmp_path: Path) -> None:
    """Named lists merge by name, null removes, other lists replace; the nearest file wins."""
    _file(tmp_path, "extends: paper\nlaw: pid\nseed: 3\nplant: {integrator: euler}\n", "first.yaml")
    name = _file(
        tmp_path,
        """
        extends: first.yaml
        description: mine
        robot:
          base: {mass: 300, panels: null}
          arms: {arm_b: {gripper: {mass: 0.9}, limits: {joint_2: {effort: 20}}}}
        deputy: {size: [0.2, 0.4, 0.2]}
        schedule:
          phases:
            - {name: carry, duration: 30}
            - {name: rest, duration: 5, arms: {arm_a: hold, arm_b: hold}}
        trajectory: {time_law: quintic}
        plant: {integrator: rk4}
        """,
    )
    found, paper = load_scenario(name, {"seed": 4}), load_scenario("paper")
    robot, before = found.truth.robot.description, paper.truth.robot.description
    assert (robot.base.inertia.mass, robot.base.panels, robot.base.size) == (300.0, (), before.base.size)
    assert robot.arms[0] == before.arms[0]
    assert (robot.arms[1].gripper.mass, robot.arms[1].gripper.radius) == (0.9, before.arms[1].gripper.radius)
    assert (robot.arms[1].joints[1].effort, robot.arms[1].mount) == (20.0, before.arms[1].mount)
    schedule = found.model.schedule
    np.testing.assert_array_equal(schedule.deputy.size, [0.2, 0.4, 0.2])
    assert [phase.name for phase in schedule.phases][-2:] == [paper.model.schedule.phases[-1].name, "rest"]
    assert found.end_ns - paper.end_ns == 15_000_000_000
    parameters = found.parameters
    assert (parameters.controller.law, parameters.common.seed) == ("pid", 4)
    assert (parameters.plant.integrator, parameters.trajectory.time_law) == ("rk4", "quintic")


def test_the_plant_has_the_truth_and_all_others_the_model(tmp_path: Path) -> None:
    """Where the two are the same nothing changes; where they differ the law is no longer exact."""
    name = _file(tmp_path, HEAVY)
    paper, wrong = load_scenario("paper", {"common": {"duration": 0.3}}), load_scenario(name)
    assert paper.truth is paper.model
    assert wrong.model.robot.mass == paper.truth.robot.mass
    assert wrong.truth.robot.mass == pytest.approx(paper.truth.robot.mass + 24.0)
    assert compare_runs(simulate(wrong), simulate(paper))
    by_value = load_scenario("paper", {"common.duration": 0.3, "truth.robot.base.mass": 264.0})
    assert compare_runs(simulate(wrong), simulate(by_value)) == ()
    nobody_is_wrong = load_scenario(name, {"robot.base.mass": 264.0})
    assert compare_runs(simulate(nobody_is_wrong), simulate(wrong))
    believed = load_scenario("paper", {"model.deputy.in_world.xyz[0]": 1.3, "truth.deputy.size[0]": 0.2})
    assert believed.model.schedule.deputy.deputy_in_world.position[0] == 1.3
    assert believed.truth.schedule.deputy.deputy_in_world.position[0] != 1.3
    assert (believed.truth.schedule.deputy.size[0], believed.model.schedule.deputy.size[0]) == (0.2, 0.1)


def test_what_a_role_has_not_stays_away(tmp_path: Path) -> None:
    """A null of one role reaches the robot through a file that extends the one it stands in."""
    _file(tmp_path, "extends: paper\ntruth: {robot: {base: {panels: null, mass: 250.0}}}\n", "first.yaml")
    name = _file(tmp_path, "extends: first.yaml\ntruth: {robot: {base: {mass: 260.0}}}\n")
    found = load_scenario(name)
    assert found.truth.robot.description.base.panels == ()
    assert found.truth.robot.description.base.inertia.mass == 260.0
    assert found.model.robot.description.base.panels


def test_what_is_recorded_tells_truth_and_model(tmp_path: Path) -> None:
    """The record of a scenario with values of all kinds needs only those of one role beside it."""
    source = load_scenario_file(_file(tmp_path, HEAVY))
    of_roles = "model.robot.arms.arm_a.gripper.mass:=0.9"
    given = Replacements(values=("robot.base.com[0]:=0.01", of_roles))
    text = as_yaml(resolved(source, given))
    again = load_scenario(_file(tmp_path, text, "again.yaml"), {"common": {"values": [of_roles]}})
    before = load_scenario(str(tmp_path / "mine.yaml"), {"common": {"values": list(given.values)}})
    assert again.truth.robot.urdf == before.truth.robot.urdf != before.model.robot.urdf
    assert again.model.robot.urdf == before.model.robot.urdf


REFUSED = {
    "unknown name": ("extends: papr\n", r"mine.yaml:1: unknown scenario 'papr' \(did you mean 'paper'\?\)"),
    "no file": ("extends: none.yaml\n", r"mine.yaml:1: there is no file .*none.yaml"),
    "cycle": ("extends: mine.yaml\n", "mine.yaml:1: scenarios extend each other: mine extends mine"),
    "key": ("extends: paper\nrobt: {}\n", r"mine.yaml:2: unknown key 'robt' \(did you mean 'robot'\?\)"),
    "alone": ("law: pid\n", "mine.yaml:1: schedule is missing: give a file, or extend a scenario"),
    "range": (
        "extends: paper\nrobot:\n  base:\n    mass: -1\n",
        r"mine.yaml:4: base.mass is -1 kg, must be > 0 kg",
    ),
    "of a role": (
        "extends: paper\ntruth:\n  robot:\n    base:\n      mas: 1\n",
        r"mine.yaml:5: base: unknown key 'mas' \(did you mean 'mass'\?\)",
    ),
    "schedule of a role": (
        "extends: paper\nmodel: {schedule: {}}\n",
        "mine.yaml:2: model: unknown key 'schedule'",
    ),
    "name": (
        "extends: paper\nrobot: {arms: [{name: [1]}]}\n",
        r"mine.yaml:2: arms\[0\].description is missing",
    ),
    "phase": (
        "extends: paper\nschedule: {phases: {carry: 3}}\n",
        "mine.yaml:2: carry is 3, must be a mapping or null",
    ),
    "nothing to remove": (
        "extends: paper\nrobot: {base: {panel: null}}\n",
        r"mine.yaml:2: null: unknown key 'panel' \(did you mean 'panels'\?\)",
    ),
    "parameter": (
        "extends: paper\nplant: {integratr: rk4}\n",
        r"mine.yaml:2: unknown parameter 'integratr' \(did you mean 'integrator'\?\)",
    ),
    "value": ("extends: paper\nseed: -1\n", "mine.yaml:2: parameter 'seed' is -1, must be >= 0"),
    "law": (
        "extends: paper\nlaw: pdi\n",
        r"mine.yaml:2: .*unknown control law 'pdi' \(did you mean 'pid'\?\)",
    ),
    "arm file": (
        "extends: paper\nrobot: {arms: {arm_a: {description: none.yaml}}}\n",
        "cannot read .*none.yaml: No such file",
    ),
    "joints": (
        "extends: paper\nmodel: {robot: {arms: {arm_b: null}}}\n",
        "unknown key 'arm_b'|truth has the joints",
    ),
}


@pytest.mark.parametrize(("text", "words"), REFUSED.values(), ids=list(REFUSED))
def test_what_is_wrong_is_named_with_its_line(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_scenario(_file(tmp_path, text))
    assert re.search(words, str(caught.value))
    assert "\n" not in str(caught.value)


def test_a_merge_changes_neither_of_the_two() -> None:
    base = load_mapping("a: &x {b: [{name: n, c: 1}]}\nd: *x\n", Path("base.yaml"))
    change = load_mapping("a: {b: {n: {c: 2}, m: {c: 3}}}\ne: [1]\n", Path("change.yaml"))
    found = merged(base, change, Path("change.yaml"))
    assert found == {
        "a": {"b": [{"name": "n", "c": 2}, {"c": 3, "name": "m"}]},
        "d": {"b": [{"name": "n", "c": 1}]},
        "e": [1],
    }
    assert base == load_mapping("a: &x {b: [{name: n, c: 1}]}\nd: *x\n", Path("base.yaml"))
    removed = merged(found, load_mapping("a: {b: {n: null}}\n", Path("c.yaml")), Path("c.yaml"))
    assert removed["a"] == {"b": [{"c": 3, "name": "m"}]}


def test_the_default_is_shipped(scenario: Scenario) -> None:
    assert scenario.parameters.common.scenario in scenario_names()
