"""Cases of a campaign: their rows, what is read back, and how a case ends that ends badly."""

import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.equality import compare_runs, run_digest
from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_process import CASE_PROGRAM, CaseProcess
from sms_handover.campaign.cases.case_row import Row, Status, Task, row_of
from sms_handover.campaign.cases.read_back import is_same, read_back
from sms_handover.campaign.cases.retained import trajectory
from sms_handover.campaign.definition.campaign_file import Limits
from sms_handover.campaign.definition.frozen import freeze
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.journal import Entry
from sms_handover.campaign.statistics.case_columns import columns_of
from sms_handover.campaign.statistics.paired_tests import paired_tests
from sms_handover.campaign.statistics.worst_cases import failures_by_cause, worst_of
from sms_handover.errors import ConfigurationError, NoPlanError, SmsHandoverError
from sms_handover.simulation import loop as loops
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .campaigns import MASS, STUB, rows_of, run_here, written

TASK = Task(0, "smooth", "nmpc")


def cases_of(folder: Path, **changes: Any) -> Cases:
    """Return the cases of a campaign that is written below a folder."""
    return Cases(*freeze(written(folder / "file", **changes)), folder / "unpacked")


def test_without_uncertainty_a_case_is_the_run_of_simulate(tmp_path: Path) -> None:
    cases = cases_of(tmp_path, draws={MASS: {"normal": {"mean": 240, "std": 0}}})
    result = cases.run(TASK)
    run = simulate(load_scenario("smooth", {"common.duration": 0.04, "law": "nmpc"}))
    assert result.run is not None and compare_runs(result.run, run) == ()
    assert result.row.run_digest == run_digest(run) and result.row.status is Status.SUCCEEDED
    other = simulate(load_scenario("smooth", {"common.duration": 0.04, "law": "pid"}))
    assert run_digest(other) != result.row.run_digest


def test_a_row_is_a_pure_function(tmp_path: Path) -> None:
    cases = cases_of(tmp_path, laws=["nmpc", "pid"])
    tasks = [Task(case, "smooth", law) for case in range(2) for law in ("nmpc", "pid")]
    first = {task: cases.run(task).row.digest for task in tasks}
    assert {task: cases.run(task).row.digest for task in reversed(tasks)} == first
    assert len(set(first.values())) == 4
    rows = {task: cases.run(task).row for task in tasks}
    assert rows[tasks[0]].inputs == rows[tasks[1]].inputs and rows[tasks[0]].seed == rows[tasks[1]].seed
    row = rows[tasks[0]]
    assert row_of(json.loads(row.text)) == row and row_of(json.loads(row.text)).text == row.text


DRAWN: dict[str, float | str] = {
    "truth.robot.base.mass": 251.0,
    "model.robot.base.mass": 233.0,
    "robot.base.com[1]": 0.01,
    "robot.arms.arm_a.gripper.mass": 0.7,
    "robot.arms.arm_b.rotor_inertia[2]": 0.25,
    "truth.robot.arms.arm_a.description.joints[1].link.mass": 1.2,
    "truth.robot.arms.arm_a.description.joints[3].link.com[2]": -0.0151,
    "robot.arms.arm_b.mount.xyz[1]": -0.301,
    "deputy.in_world.xyz[0]": 1.049,
    "truth.deputy.in_world.rpy[2]": 0.02,
    "deputy.size[0]": 0.11,
    "deputy.mass": 4.0,
    "common.conditions": "nominal",
    "truth.deputy.twist_in_world.angular[1]": 0.01,
    "schedule.phases.carry.duration": 21.0,
    "plant.grasp_position_tolerance": 0.02,
    "controller.rolling_period": 1.1,
    "law": "pid",
    "seed": 7,
    "common.tick": 0.002,
}


@pytest.mark.parametrize("path", DRAWN)
def test_what_is_read_back_is_what_was_set(path: str) -> None:
    at_rest = {"deputy.twist_in_world": {"linear": [0.0, 0.0, 0.0], "angular": [0.0, 0.0, 0.0]}}
    loop = Loop(load_scenario("smooth", {**at_rest, path: DRAWN[path]}))
    before = Loop(load_scenario("smooth", at_rest))
    assert is_same(DRAWN[path], read_back(loop, path))
    assert not is_same(DRAWN[path], read_back(before, path))


def test_masses_are_read_back_from_what_the_plant_integrates() -> None:
    loop = Loop(load_scenario("smooth", {"truth.robot.base.mass": 251.0}))
    assert read_back(loop, "model.robot.base.mass") == 240.0
    loop.scenario.truth.robot.pin.inertias[1].mass = 7.0
    assert read_back(loop, "truth.robot.base.mass") == 7.0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("conditions.friction.viscous", 0.1),
        ("conditions.command.delay", 0.004),
        ("conditions.sensors.encoders.step", 3e-5),
        ("conditions.sensors.gyro.bias[1]", 1e-5),
        ("conditions.sensors.vision.latency", 0.2),
        ("conditions.model_error.base.mass", 0.02),
        ("conditions.wrenches.solar_pressure.constant.force[0]", -3e-5),
        ("conditions.wrenches.gravity.gravity_gradient.radius", 6.9e6),
        ("conditions.sensors.encoders.offset", 7e-4),
        ("conditions.sensors.star_tracker.period", 0.2),
        ("conditions.wrenches.told.history.rows[1][2]", 3.0),
    ],
)
def test_conditions_are_read_back_from_the_plant(path: str, value: float) -> None:
    """Of sensors too, which compiled ticks do not read."""
    told = {"conditions.wrenches.told.history": {"rows": [[0.0] * 7, [1.0] * 7]}}
    nominal = {"common.conditions": "nominal", "common.dynamics": "compiled", **told}
    assert read_back(Loop(load_scenario("smooth", {**nominal, path: value})), path) == value
    assert read_back(Loop(load_scenario("smooth", nominal)), path) != value


@pytest.mark.parametrize("path", ["deputy.size", "robot.name", "schedule.phases.carry.name", "robot.no"])
def test_what_cannot_be_read_back_cannot_be_drawn(path: str) -> None:
    with pytest.raises(ConfigurationError, match=r"so it cannot be drawn|is no single value"):
        read_back(Loop(load_scenario("smooth")), path)


def test_a_drawn_file_is_in_its_row_as_in_its_draw(tmp_path: Path) -> None:
    """Its run is that under the shipped conditions of the name, bit for bit."""
    drawn = {"choice": {"values": ["nominal"]}}
    row = cases_of(tmp_path, draws={"common.conditions": drawn}).run(TASK).row
    values = {"common.duration": 0.04, "law": "nmpc", "seed": row.seed, "common.conditions": "nominal"}
    assert row.inputs == {"common.conditions": "nominal"}
    assert row.run_digest == run_digest(simulate(load_scenario("smooth", values)))


def test_a_cause_does_not_depend_on_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = cases_of(tmp_path)
    told = f"{tmp_path}/unpacked/scenarios/smooth.yaml:3: {object()!r} of mode 0x10 (at 0x7f00deadbeef)"
    monkeypatch.setattr(cases, "scenario", lambda task: (_ for _ in ()).throw(KeyError(told)))
    cause = cases.run(TASK).row.cause
    assert cause == 'KeyError: "scenarios/smooth.yaml:3: <object object> of mode 0x10 ()"'.replace('"', "'")


def test_a_draw_that_does_not_arrive_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = cases_of(tmp_path)
    scenario = load_scenario("smooth", {"common.duration": 0.04})
    monkeypatch.setattr(cases, "scenario", lambda task: scenario)
    row = cases.run(TASK).row
    assert row.status is Status.ERROR and row.cause.startswith(f"{MASS} was drawn as")


def test_a_draw_that_no_scenario_can_have_is_a_row(tmp_path: Path) -> None:
    row = cases_of(tmp_path, draws={MASS: {"uniform": {"low": -2, "high": -1}}}).run(TASK).row
    assert (row.status, row.numeric_failure, row.mission_failure) == (Status.REJECTED, True, False)
    assert "mass is -1." in row.cause and "must be > 0" in row.cause


def test_a_mission_failure_is_no_numeric_failure(tmp_path: Path) -> None:
    row = cases_of(tmp_path, success="complete", worst_by="approach.arm_a.final_error").run(TASK).row
    assert (row.status, row.numeric_failure, row.mission_failure) == (Status.MISSION_FAILED, False, True)
    assert row.cause == "not complete: ended at 0.04 s, the task ends at 60 s" and row.run_digest
    assert "approach.arm_a.final_error" in row.metrics, "or no case could be the worst"
    cases = cases_of(tmp_path / "other", success="base_turn < 0")  # which says nothing of the end
    alike = [cases.run(TASK._replace(case=case)) for case in range(2)]
    assert re.fullmatch(r"not base_turn < 0 \(base_turn is [\d.e-]+\)", alike[0].row.cause)
    counted = failures_by_cause(Entry(one.row, one.beside) for one in alike)
    assert counted == {("smooth", "nmpc", "mission failed", "not base_turn < # (base_turn is #)"): 2}


def test_a_run_without_a_plan_is_a_failed_mission_with_its_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its run is there as far as it came; without metrics, and no success where laws are paired."""
    cases = cases_of(tmp_path, laws=["nmpc", "pid"])
    good, advance, at_rest_ns = cases.run(TASK), loops.Loop._advance, 20_000_000

    def gives_up(loop: Loop, most: int) -> Any:
        if loop.law == "pid" and loop.state.stamp_ns == at_rest_ns:
            raise NoPlanError("no plan, at rest at 0.02 s: rate arm_a_joint_3 is 1e-3 too large")
        return advance(loop, most)

    monkeypatch.setattr(loops.Loop, "_advance", gives_up)
    result = cases.run(TASK._replace(law="pid"))
    row, run = result.row, result.run
    assert (row.status, row.numeric_failure, row.mission_failure) == (Status.MISSION_FAILED, False, True)
    assert row.metrics == {} and row.inputs == good.row.inputs
    assert run is not None and run.tick_ns[-1] == at_rest_ns - 1_000_000 and row.run_digest == run_digest(run)
    entries = [Entry(one.row, one.beside) for one in (good, result)]
    assert failures_by_cause(entries) == {
        (
            "smooth",
            "pid",
            "mission failed",
            "no plan, at rest at # s: rate arm_a_joint_3 is # too large",
        ): 1
    }
    success, effort = paired_tests(columns_of(entries), ["control_effort"])
    assert (success.cases, success.difference, effort.cases) == (1, 1.0, 0)
    assert list(worst_of(entries, "control_effort", 5)) == [("smooth", "nmpc")]


def test_a_run_beyond_its_ticks_is_a_row(tmp_path: Path) -> None:
    row = cases_of(tmp_path, limits={"ticks": 10}).run(TASK).row
    assert (row.status, row.cause, row.run_digest) == (Status.LIMIT, "more than 10 ticks", "")


def test_numbers_that_are_not_finite_are_a_numeric_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cases = cases_of(tmp_path)
    data = loops.Loop._advance

    def broken(loop: Loop, most: int) -> Any:
        ticks = data(loop, most)
        rows = replace(ticks.rows, v=np.full_like(ticks.rows.v, np.nan))
        return replace(ticks, rows=rows)

    monkeypatch.setattr(loops.Loop, "_advance", broken)
    row = cases.run(TASK).row
    assert (row.status, row.cause) == (Status.NUMERIC_FAILURE, "numbers that are not finite")


def test_bad_cases_end_as_rows_with_their_causes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scratch").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "scratch"))
    limits = {"wall_time": 3.0, "memory": 100.0, "retries": 1}
    file = written(tmp_path, name="bad", cases=5, limits=limits)
    run_here(file, tmp_path / "out", program=STUB)
    rows = {task.case: row for task, row in rows_of(tmp_path / "out").items()}
    tries = {entry.row.task.case: entry.beside.tries for entry in CampaignFolder(tmp_path / "out").entries()}
    assert tries == {0: 1, 1: 1, 2: 2, 3: 1, 4: 1}, "only what died is tried again"
    assert (rows[1].status, rows[1].cause) == (Status.LIMIT, "more than 3 s of wall time")
    assert (rows[2].status, rows[2].cause) == (
        Status.DIED,
        "its process ended by signal SIGKILL: case 2 dies",
    )
    assert (rows[3].status, rows[3].cause) == (Status.LIMIT, "more than 100 MB of memory (limits.memory)")
    assert [rows[case].run_digest for case in range(5)] == ["00", "", "", "", "00"]
    assert not list((tmp_path / "scratch").iterdir()), "whoever was killed left nothing behind"


def test_a_process_whose_parent_is_killed_while_it_starts_leaves_nothing(tmp_path: Path) -> None:
    frozen, number = freeze(written(tmp_path))
    (tmp_path / "scratch").mkdir()
    child = subprocess.Popen(CASE_PROGRAM, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert child.stdin and child.stdout
    child.stdout.close()
    first = {"files": dict(frozen.files), "cases": number, "folder": str(tmp_path / "scratch")}
    child.communicate(json.dumps(first).encode() + b"\n")
    assert not (tmp_path / "scratch").exists()


def test_a_process_that_cannot_start_is_an_error(tmp_path: Path) -> None:
    frozen, number = freeze(written(tmp_path))
    with pytest.raises(SmsHandoverError, match="cannot start: its process ended with exit code 1"):
        CaseProcess(frozen, number, 3, Limits(), ("/bin/false",)).run(TASK)


def test_a_process_that_is_killed_as_it_starts_is_started_again(tmp_path: Path) -> None:
    """As often as cases are tried again, which here is once."""
    frozen, number = freeze(written(tmp_path))
    seen = tmp_path / "seen"
    killed_once = f'[ -e "{seen}" ] && exec "$@"; touch "{seen}"; kill -9 $$'
    process = CaseProcess(frozen, number, 3, Limits(), ("/bin/sh", "-c", killed_once, "sh", *STUB))
    assert process.run(TASK).row.status is Status.MISSION_FAILED  # as the stub has it of case 0
    process.close()
    with pytest.raises(SmsHandoverError, match="cannot start: its process ended by signal SIGKILL"):
        CaseProcess(frozen, number, 3, Limits(), ("/bin/sh", "-c", "kill -9 $$")).run(TASK)


def test_a_trajectory_has_a_row_per_reference(tmp_path: Path) -> None:
    run = cases_of(tmp_path).run(TASK).run
    assert run is not None
    file = tmp_path / "trajectory.npz"
    file.write_bytes(trajectory(run))
    with np.load(file, allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["stamp_ns"], run.reference_ns)
        np.testing.assert_array_equal(arrays["joint_position"][1], run.joint_position[20])


def test_rows_that_differ_have_different_digests() -> None:
    row = Row(TASK, 1, {"a": 1.0}, Status.SUCCEEDED, "", {"x": 0.1}, "0")
    changes: list[dict[str, Any]] = [{"seed": 2}, {"inputs": {"a": 1.0 + 3e-16}}, {"metrics": {"x": None}}]
    assert len({row.digest, *(replace(row, **change).digest for change in changes)}) == 4
