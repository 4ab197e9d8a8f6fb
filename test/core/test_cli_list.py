"""``sms-handover list``, ``show`` and ``check``: what has a name, one thing in full, what can be run."""

import json
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest
from my_controller.law import LAW

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.definitions import DEFINITIONS
from sms_handover.analysis.equality import compare_runs
from sms_handover.analysis.records import UNITS, records_of
from sms_handover.cli.main import main
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .bag_messages import made_up_run
from .laws import offer


def listed(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict[str, Any]]:
    """Return what ``list`` prints as JSON."""
    assert main(["list", *words, "--json"]) == 0
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)
    return found


def test_every_figure_of_a_comparison_has_unit_and_definition(capsys: pytest.CaptureFixture[str]) -> None:
    rows = listed(capsys, "metrics")
    units = {row["metric"]: row["unit"] for row in rows}
    rows_of_run = records_of(compare({"one": made_up_run()}))
    found = {row.figure: row.unit for row in rows_of_run if not row.figure.startswith("clearance: ")}
    assert units == units | found
    assert set(units) == set(UNITS) == set(DEFINITIONS)
    assert all(row["definition"] for row in rows)


def test_a_law_of_another_package_is_listed_with_where_it_comes_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    laws = {"task_space_pd": "my_controller.law:LAW", "broken": "my_controller.no_such:LAW"}
    monkeypatch.syspath_prepend(offer(tmp_path / "site", "my_controller", **laws))
    rows = {row["law"]: row for row in listed(capsys, "laws")}
    assert list(rows) == ["nmpc", "pid", "mpc", "broken", "task_space_pd"]
    assert rows["nmpc"]["package"] == "sms_handover"
    assert rows["task_space_pd"] == {
        "law": "task_space_pd",
        "package": "my_controller",
        "needs": ", ".join(sorted(need.value for need in LAW.needs)),
        "description": LAW.description,
    }
    assert rows["broken"]["description"].startswith("unusable: control law 'broken' of my_controller")
    assert main(["show", "task_space_pd"]) == 0
    assert "stiffness" in capsys.readouterr().out


def test_every_path_can_be_set_to_the_value_that_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """All at once, which changes nothing; those of the scenario that is named."""
    rows = {row["path"]: row for row in listed(capsys, "paths", "paper")}
    assert (rows["robot.base.mass"]["unit"], rows["plant.integrator"]["allowed"]) == ("kg", "midpoint | rk4")
    paper = load_scenario("paper")
    values = {path: row["value"] for path, row in rows.items() if row["value"] is not None}
    again = load_scenario("paper", values)
    assert again.truth.robot.urdf == paper.truth.robot.urdf
    assert again.parameters.ik == paper.parameters.ik
    assert main(["list", "paths", "paper"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(rows) + 1
    assert main(["list", "laws", "paper"]) == 2


def test_a_law_is_shown_with_unit_default_and_range(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "nmpc"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["controller.rolling_period", "s", "1.0", "at", "least", "0.001"] in [line[:6] for line in lines]
    assert main(["show", "npmc"]) == 2  # may be a scenario or a law
    assert "(did you mean 'nmpc'?)" in capsys.readouterr().err


TRUE_AND_MODEL = """
extends: paper
law: pid
truth: {robot: {base: {mass: 264.0}}}
common: {tick: 0.0005, mode: realtime, values: [robot.base.mass:=200, model.robot.base.mass:=210]}
ik: {position_tolerance: 1e-7}
"""


@pytest.mark.parametrize("name", [*scenario_names(), "mine.yaml"])
def test_a_scenario_that_was_shown_makes_the_same_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Shown again it is the same text; all is in it, with truth and model apart."""
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(TRUE_AND_MODEL, encoding="utf-8")
    assert main(["show", name]) == 0
    text = capsys.readouterr().out
    Path("shown.yaml").write_text(text, encoding="utf-8")
    assert main(["show", "shown.yaml"]) == 0
    assert capsys.readouterr().out == text
    short = {"common": {"duration": 0.1}}
    one, other = load_scenario(name, short), load_scenario("shown.yaml", short)
    for section in ("plant", "trajectory", "ik", "controller"):
        assert astuple(getattr(one.parameters, section)) == astuple(getattr(other.parameters, section))
    assert one.truth.robot.mass == other.truth.robot.mass
    assert compare_runs(simulate(one), simulate(other)) == ()


@pytest.mark.parametrize("file", [None, "handover.yaml", "recorder.yaml", "scenarios/paper.yaml"])
def test_what_can_be_run_is_told_with_where_each_phase_ends(
    file: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name or a file of any kind: its keys say what it is."""
    options = ("-p", "common.scenario:=paper", "--no-dry-run")
    assert main(["check", str(config_file(file)) if file else "paper", *options]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["phase", "ends", "[s]", "base", "rotation", "[deg]", "IK", "restarts"]
    assert [line[:2] for line in lines[1:4]] == [["approach", "20"], ["carry", "40"], ["withdraw", "60"]]
    assert lines[-1][-3:] == ["can", "be", "run"]


def test_a_robot_is_checked_alone(capsys: pytest.CaptureFixture[str]) -> None:
    robot = str(config_file("robot.yaml"))
    assert main(["check", robot]) == 0
    assert "254 kg; arm_a with 7 joints; arm_b with 7 joints" in capsys.readouterr().out
    assert main(["check", robot, "--schedule", str(config_file("handover.yaml")), "--no-dry-run"]) == 0
    assert " with robot " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["papr"], "unknown scenario 'papr' (did you mean 'paper'?)"),
        (["folder"], "'sms-handover bag check folder' checks a recording"),
        (["paper", "-p", "schedule.phases.carry.duration:=-1"], "must be"),
        (["colliding", "--duration", "2", "--reject-collisions"], "bodies collide from 1.80 s on"),
        (["robot.yaml"], "robot.yaml:1: "),
        (["robot.yaml", "-p", "plant.integrator:=euler"], "is a robot, checked alone"),
        (["parameters.yaml"], "parameters.yaml:1: parameter 'integrator'"),
        (["mine.yaml"], "mine.yaml:1: unknown key 'lw'"),
    ],
)
def test_what_cannot_be_run_is_one_line(
    words: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("robot.yaml").write_text("arms: []", encoding="utf-8")
    Path("mine.yaml").write_text("lw: pid", encoding="utf-8")
    Path("parameters.yaml").write_text("plant: {ros__parameters: {integrator: eulr}}", encoding="utf-8")
    assert main(["check", *words]) == 2
    out, err = capsys.readouterr()
    assert told in err and err.count("\n") == 1 and out == ""
