"""Two runs are the same only if every field is; what differs is told with its place."""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.equality import Difference, as_far_as_recorded, before, compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.events import RunEvent, Severity
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.plan_report import PlannedPaths, PlanReport, PlanStatus
from sms_handover.run_data import RunData
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus

from .bag_messages import made_up_run

PANELS: dict[str, Any] = {  # of a run whose panels swing
    "panel_names": ("panel_1_hinge",),
    "panel_position": np.zeros((6, 1)),
    "panel_velocity": np.zeros((6, 1)),
}
OLD = Path(__file__).parent.parent / "data" / "first_edition" / "nmpc"
ARRAYS = [item.name for item in fields(RunData) if isinstance(getattr(made_up_run(3), item.name), np.ndarray)]
PER_ARM = ("target_pose", "tool_pose")
EVENTS = ("grasp_events", "run_events", "plans", "base_wrenches")
TEXTS = ("joint_names", "arms", "phases", "panel_names", "planned_paths", "measured", "applied", *EVENTS)


@pytest.fixture
def run() -> RunData:
    return replace(made_up_run(), **PANELS)


def changed(array: np.ndarray, row: int, change: Callable[[Any], Any]) -> Any:
    """Return a copy of an array with the last entry of one row changed."""
    copy = array.copy()
    place = (row, -1) if copy.ndim == 2 else (row,)
    copy[place] = change(copy[place])
    return copy


def test_every_field_is_covered() -> None:
    assert {*ARRAYS, *PER_ARM, *TEXTS} == {item.name for item in fields(RunData)}


def test_a_run_is_itself(run: RunData) -> None:
    assert compare_runs(run, run) == ()
    assert compare_runs(run, replace(made_up_run(), **PANELS)) == ()


@pytest.mark.parametrize("name", ARRAYS)
def test_one_bit_in_any_array_is_a_difference(run: RunData, name: str) -> None:
    array = getattr(run, name)
    row = array.shape[0] // 2
    step: Callable[[Any], Any] = (
        (lambda value: value + 1) if array.dtype == np.int64 else lambda value: np.nextafter(value, np.inf)
    )
    other = replace(run, **{name: changed(array, row, step)})
    for differences in (compare_runs(run, other), compare_runs(other, run)):
        (difference,) = differences
        assert difference.field == name
        assert f"1 of {array.shape[0]} rows, first row {row}, by " in difference.detail
        assert str(difference) == f"{name}: {difference.detail}"


def test_what_an_older_version_did_not_record_is_named_and_the_rest_judged(run: RunData) -> None:
    run = replace(run, grasp_events=tuple(replace(event, relative_rate=0.1) for event in run.grasp_events))
    twist = np.full_like(run.deputy_twist, np.nan)
    events = tuple(replace(event, relative_rate=nan) for event in run.grasp_events)
    old = replace(run, deputy_twist=twist, grasp_events=events)
    assert {each.field for each in compare_runs(old, run)} == {"deputy_twist", "grasp_events"}
    again, missing = as_far_as_recorded(old, run)
    assert missing == ("deputy_twist", "grasp_events.relative_rate") and compare_runs(old, again) == ()
    other = replace(run, kinetic_energy=changed(run.kinetic_energy, 1, lambda value: value + 1.0))
    (difference,) = compare_runs(old, as_far_as_recorded(old, other)[0])
    assert difference.field == "kinetic_energy"
    acted, sensed = {"command": {"delay": 0.003}}, {"sensors": {"gyro": {"period": 0.0}}}
    old, now = (replace(run, applied=json.dumps(values)) for values in (acted, {**acted, **sensed}))
    again, missing = as_far_as_recorded(old, now)
    assert missing == ("applied.sensors",) and compare_runs(old, again) == ()
    assert as_far_as_recorded(now, now)[1] == ()
    (difference,) = compare_runs(now, as_far_as_recorded(now, old)[0])
    assert difference.field == "applied"


def test_of_the_first_edition_only_rounding_differs() -> None:
    """Its bags have no twist of the deputy, and no rates of grasps; sums were done in another order once."""
    with TemporaryDirectory() as folder:
        again = simulate(scenario_in(read_info(OLD), Path(folder)))
    recorded = read_run(OLD)
    again, missing = as_far_as_recorded(recorded, before(again, int(recorded.tick_ns[-1]) + 1))
    lacking = ("relative_rate", "relative_twist")
    assert missing == ("deputy_twist", "applied", *(f"grasp_events.{name}" for name in lacking))
    for name in ARRAYS:
        np.testing.assert_allclose(getattr(again, name), getattr(recorded, name), rtol=0.0, atol=1e-12)


def test_a_plan_is_the_same_however_long_it_took(run: RunData) -> None:
    plan = PlanReport(0, 1, PlanStatus.SOLVED, 3, ("rate of a",), 0.1, "rate of a", 1e-9, 0.1, 0.2, 0.3, 0.0)
    slow = replace(plan, linearization_time=1.0, program_time=2.0, total_time=3.0)
    other = replace(plan, largest_slack=np.nextafter(0.1, 1.0))
    mine = replace(run, plans=(plan,))
    assert compare_runs(mine, replace(run, plans=(slow,))) == ()
    (difference,) = compare_runs(mine, replace(run, plans=(other,)))
    assert difference.field == "plans"


def test_one_bit_in_a_planned_path_is_a_difference(run: RunData) -> None:
    one, other = (PlannedPaths(0, {"arm_a": np.full((2, 3), x)}) for x in (0.1, np.nextafter(0.1, 1.0)))
    (difference,) = compare_runs(replace(run, planned_paths=(one,)), replace(run, planned_paths=(other,)))
    assert difference.field == "planned_paths"


@pytest.mark.parametrize("name", PER_ARM)
@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_one_bit_in_the_poses_of_an_arm_is_a_difference(run: RunData, name: str, arm: str) -> None:
    poses: Any = dict(getattr(run, name))
    poses[arm] = changed(poses[arm], 1, lambda value: np.nextafter(value, -np.inf))
    (difference,) = compare_runs(run, replace(run, **{name: poses}))
    assert difference.field == f"{name}[{arm}]"
    assert "first row 1" in difference.detail


def test_an_arm_that_only_one_has_is_a_difference(run: RunData) -> None:
    poses = {"arm_a": run.target_pose["arm_a"]}
    expected = (Difference("target_pose[arm_b]", "only one of the runs has it"),)
    assert compare_runs(run, replace(run, target_pose=poses)) == expected
    assert compare_runs(replace(run, target_pose=poses), run) == expected


def test_rows_and_size_of_a_difference_are_told(run: RunData) -> None:
    position = run.joint_position.copy()
    position[7, 3] += 0.5
    position[9] += 0.25
    (difference,) = compare_runs(run, replace(run, joint_position=position))
    assert difference.detail == f"2 of {len(position)} rows, first row 7, by 0.5 at most"


def test_a_run_that_is_shorter_is_a_difference(run: RunData) -> None:
    (difference,) = compare_runs(run, replace(run, work=run.work[:-1]))
    assert difference == Difference("work", f"shapes ({len(run.work)},) and ({len(run.work) - 1},)")


def test_what_is_missing_in_both_is_the_same(run: RunData) -> None:
    """NaN stands for what was not recorded; against a number it is a difference."""
    with_nan = replace(run, joint_effort=changed(run.joint_effort, 4, lambda value: np.nan))
    again = replace(run, joint_effort=changed(run.joint_effort, 4, lambda value: np.nan))
    assert compare_runs(with_nan, again) == ()
    for differences in (compare_runs(run, with_nan), compare_runs(with_nan, run)):
        assert [difference.field for difference in differences] == ["joint_effort"]
        assert "1 of" in differences[0].detail and "first row 4" in differences[0].detail
        assert differences[0].detail.endswith("where only one run has numbers")


def test_names_phases_and_events_count(run: RunData) -> None:
    event = run.grasp_events[0]
    others: dict[str, Any] = {
        "joint_names": (*run.joint_names[:-1], "arm_b_joint_8"),
        "arms": run.arms[:-1],
        "phases": run.phases[:-1],
        "grasp_events": (replace(event, status=GraspStatus.REJECTED), *run.grasp_events[1:]),
    }
    for name, value in others.items():
        (difference,) = compare_runs(run, replace(run, **{name: value}))
        assert difference.field == name
    (difference,) = compare_runs(run, replace(run, phases=run.phases[:-1]))
    assert difference.detail == f"{len(run.phases)} items and {len(run.phases) - 1} items"
    (difference,) = compare_runs(run, replace(run, grasp_events=others["grasp_events"]))
    assert difference.detail.startswith("item 0 is ")


def test_the_order_of_arms_and_joints_decides_nothing(run: RunData) -> None:
    """A reader finds them in the order of a message, a robot file lists them in another."""
    order = np.random.default_rng(0).permutation(len(run.joint_names))
    columns = [
        *("joint_position", "joint_velocity", "joint_effort", "joint_command"),
        *("reference_position", "reference_velocity"),
    ]
    names = tuple(run.joint_names[place] for place in order)
    other: dict[str, Any] = {name: getattr(run, name)[:, order] for name in columns}
    other |= {name: dict(reversed(getattr(run, name).items())) for name in PER_ARM}
    assert compare_runs(run, replace(run, arms=run.arms[::-1], joint_names=names, **other)) == ()
    found = {difference.field for difference in compare_runs(run, replace(run, joint_names=names))}
    assert found == set(columns)


def test_of_decisions_those_count_that_follow_from_the_numbers(run: RunData) -> None:
    late = RunEvent(5, "plant", "late", Severity.WARNING, "the machine was busy")
    assert compare_runs(run, replace(run, run_events=(*run.run_events, late))) == ()
    (difference,) = compare_runs(run, replace(run, run_events=(replace(late, node="trajectory"),)))
    assert difference.field == "run_events"
    stranger = replace(late, node="trajectory", kind="refused")
    assert compare_runs(run, replace(run, run_events=(*run.run_events, stranger))) == ()


def test_events_without_errors_are_the_same_as_themselves(run: RunData) -> None:
    event = replace(run.grasp_events[0], position_error=float("nan"))
    one, other = (replace(run, grasp_events=(replace(event, position_error=float("nan")),)) for _ in range(2))
    assert compare_runs(one, other) == ()


def test_every_difference_is_told_in_the_order_of_the_fields(run: RunData) -> None:
    differences = compare_runs(run, made_up_run(seed=1))
    names = [item.name for item in fields(RunData)]
    found = [names.index(difference.field.split("[")[0]) for difference in differences]
    assert found == sorted(found)
    assert len(found) > 10
