import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.metrics import measure
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import comparison_table
from sms_handover.errors import UnknownNameError
from sms_handover.plan_report import PlanReport, PlanStatus
from sms_handover.plant.deputy import GraspTolerance
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array

from .test_analysis_claims import BAD, GOOD, HANDOVER, Law, run_of
from .test_analysis_runs import changed, grasp, line, make_run, still

TOLERANCE = GraspTolerance(0.010, 0.0349, 0.020)


@pytest.fixture(scope="module")
def pair() -> dict[str, RunData]:
    return {"nmpc": run_of(GOOD), "pid": run_of(BAD)}


def product(a: Array, b: Array) -> Array:
    """Return the quaternion products (R, 4) of two tables of turns, x y z w."""
    scalar = a[:, 3:] * b[:, 3:] - np.sum(a[:, :3] * b[:, :3], axis=1, keepdims=True)
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.column_stack([vector, scalar])


def seen_from_elsewhere(run: RunData, seed: int) -> RunData:
    """Return the same run with everything given in another world frame."""
    random = np.random.default_rng(seed)
    place, turn = random.normal(size=3), random.normal(size=(1, 4))
    turn /= np.linalg.norm(turn)

    def vectors(rows: Array) -> Array:
        pure = np.column_stack([rows, np.zeros(len(rows))])
        turned: Array = product(product(turn, pure), turn * [[-1.0, -1.0, -1.0, 1.0]])[:, :3]
        return turned

    def poses(rows: Array) -> Array:
        return np.column_stack([place + vectors(rows[:, :3]), product(turn, rows[:, 3:])])

    return changed(
        run,
        base_pose=poses(run.base_pose),
        deputy_pose=poses(run.deputy_pose),
        tool_pose={arm: poses(rows) for arm, rows in run.tool_pose.items()},
        target_pose={arm: poses(rows) for arm, rows in run.target_pose.items()},
        linear_momentum=vectors(run.linear_momentum),
        angular_momentum=vectors(run.angular_momentum),
    )


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Return every number and text of nested values with the way to it."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from leaves(inner, f"{path}/{key}")
    else:
        yield path, value


@pytest.mark.parametrize("seed", range(5))
def test_metrics_do_not_depend_on_the_world_frame(seed: int) -> None:
    law = replace(BAD, offset=0.0005, angle=0.02)
    run = run_of(law)
    random = np.random.default_rng(seed)
    momenta = random.normal(size=(2, len(run.reference_ns), 3)) * 1e-6
    run = changed(run, linear_momentum=momenta[0], angular_momentum=momenta[1])
    here = dict(leaves(summary(compare({"nmpc": run_of(GOOD), "pid": run}))))
    there = dict(
        leaves(
            summary(
                compare(
                    {"nmpc": seen_from_elsewhere(run_of(GOOD), seed), "pid": seen_from_elsewhere(run, seed)}
                )
            )
        )
    )
    assert len(here) > 500
    assert here.keys() == there.keys()
    for path, value in here.items():
        assert there[path] == (
            pytest.approx(value, rel=1e-6, abs=1e-9) if isinstance(value, float) else value
        ), path


def test_seeing_from_elsewhere_moves_everything() -> None:
    run = run_of(BAD)
    moved = seen_from_elsewhere(run, 1)
    assert np.allclose(np.linalg.norm(moved.base_pose[:, 3:], axis=1), 1.0)
    assert np.min(np.linalg.norm(moved.base_pose[:, :3] - run.base_pose[:, :3], axis=1)) > 0.1
    ways = [np.linalg.norm(r.tool_pose["arm_a"][:, :3] - r.base_pose[::2, :3], axis=1) for r in (run, moved)]
    assert np.max(np.abs(ways[0] - ways[1])) < 1e-12


@pytest.mark.parametrize(
    ("names", "judged"),
    [
        (("nmpc", "pid"), True),
        (("runs/NMPC-1", "runs/PID_2"), True),
        (("pid", "nmpc"), True),
        (("nmpc", "rapid"), False),
        (("nmpc", "nmpc 2"), False),
        (("first", "second"), False),
        (("nmpc", "pid", "other"), True),
        (("nmpc", "pid", "nmpc 2"), False),
        (("nmpc-vs-pid", "pid"), False),
    ],
)
def test_claims_are_judged_when_the_names_tell_the_laws(names: tuple[str, ...], judged: bool) -> None:
    assert bool(compare(dict.fromkeys(names, make_run(end=1.0))).claims) is judged


def test_claims_are_judged_when_the_laws_are_given() -> None:
    runs = {"pid": make_run(end=1.0), "second": make_run(end=1.0)}
    assert compare(runs, {"pid": "nmpc", "second": "pid"}).claims
    with pytest.raises(UnknownNameError, match=r"unknown run 'secnd' \(did you mean 'second'\?\)"):
        compare(runs, {"secnd": "pid"})


def test_the_law_decides_not_the_order(pair: dict[str, RunData]) -> None:
    assert all(claim.holds for claim in compare(dict(reversed(pair.items()))).claims)


def test_the_table_says_what_came_of_everything(pair: dict[str, RunData]) -> None:
    table = comparison_table(pair, tolerance=TOLERANCE)
    for text in (
        "20 s: arm_a takes end",
        "40 s: arm_b takes end from arm_a",
        "distance [mm], allowed 10",
        "Phase carry, 20 to 40 s",
        "arm_b (hold)",
        "overshoot [% of step]",
        "arm_b_joint_2",
        "largest energy residual / max E [-]",
        "Claims of the paper: 6 of 6 hold",
    ):
        assert text in table
    assert cells(table, "distance [mm], allowed 10") == ["4", "4"]
    assert cells(table, "relative speed [mm/s], allowed 20") == ["2", "2"]
    assert "DOES NOT HOLD" not in table


def test_what_a_capture_costs_is_told_where_there_was_one(pair: dict[str, RunData]) -> None:
    """With a deputy without mass no impulse is passed on, and the table does not speak of it."""
    without = comparison_table(pair, tolerance=TOLERANCE)
    assert "impulse" not in without and "lost" not in without and "relative rate" not in without
    first, *others = pair["nmpc"].grasp_events
    hit = replace(
        first, relative_rate=np.pi / 180.0, impulse=(3.0, 0.0, -4.0, 0.0, 0.2, 0.0), energy_lost=0.25
    )
    lost = np.where(pair["nmpc"].reference_ns > hit.stamp_ns, 0.25, 0.0)
    runs = {**pair, "nmpc": changed(pair["nmpc"], grasp_events=(hit, *others), lost=lost)}
    table = comparison_table(runs, tolerance=GraspTolerance(0.010, 0.0349, 0.020, np.pi / 36.0))
    assert cells(table, "relative rate [deg/s], allowed 5") == ["1", "-"]
    assert cells(table, "impulse [N s]") == ["5", "0"]
    assert cells(table, "angular impulse [N m s]") == ["0.2", "0"]
    assert cells(table, "energy lost [J]") == cells(table, "energy lost [J]", 1) == ["0.25", "0"]


def cells(table: str, label: str, place: int = 0) -> list[str]:
    """Return the cells of one of the rows with a label."""
    rows = [line.strip() for line in table.splitlines()]
    return [line.removeprefix(label).split() for line in rows if line.startswith(label)][place]


def test_columns_are_aligned(pair: dict[str, RunData]) -> None:
    runs, claims = comparison_table(pair).split("\nClaims", maxsplit=1)
    rows = [line for line in runs.splitlines() if len(line.split("  ")) > 3 or line.endswith("pid")]
    assert len(rows) > 50
    assert len({len(line) for line in rows}) == 1
    assert claims.splitlines()[0].endswith("PID")


@pytest.mark.parametrize("count", [1, 3, 12])
def test_any_number_of_runs_fits_the_width(count: int) -> None:
    run = make_run(end=25.0, events=HANDOVER[:1])
    names = [
        f"a name of a run that is far too long to be a heading by itself, number {number}"
        for number in range(count)
    ]
    table = comparison_table(dict.fromkeys(names, run))
    assert max(map(len, table.splitlines())) <= 100
    for number in range(count):
        assert f"number {number}" in table
    assert table.count("succeeded") == count


def test_a_table_of_no_runs_is_no_error() -> None:
    assert "Grasp events" in comparison_table({})


def test_a_refuted_claim_is_counted_and_marked() -> None:
    table = comparison_table({"nmpc": run_of(GOOD), "pid": run_of(replace(BAD, torque=9.0))})
    assert "Claims of the paper: 5 of 6 hold" in table
    assert "DOES NOT HOLD: The largest torque" in table
    assert cells(table, "largest torque of any joint [N m]") == ["1.5", "9"]


def test_what_never_happens_is_said_so() -> None:
    table = comparison_table({"off": run_of(replace(GOOD, offset=0.02)), "on": run_of(GOOD)})
    assert "never" in cells(table, "settling time [s]", 3)
    assert cells(table, "position drift [um/s]") == ["-", "0.1"]
    alone = comparison_table({"off": run_of(replace(GOOD, offset=0.02))})
    assert "base, drift: no run settles" in alone


def test_runs_of_different_schedules_are_put_side_by_side() -> None:
    other = make_run(phases=(("approach", 0.0), ("wait", 20.0)), events=(grasp(19.0),))
    table = comparison_table({"one": run_of(GOOD), "other": other})
    assert [line.split(",")[0] for line in table.splitlines() if line.startswith("Phase")] == [
        "Phase approach",
        "Phase carry",
        "Phase withdraw",
        "Phase wait",
    ]
    assert cells(table, "20 s: arm_a takes end") == ["succeeded", "-"]
    assert cells(table, "19 s: arm_a takes end") == ["-", "succeeded"]


def test_a_run_without_grasps_says_none() -> None:
    lines = comparison_table({"run": make_run(end=1.0)}).splitlines()
    (place,) = [number for number, line in enumerate(lines) if line.startswith("Grasp events")]
    assert lines[place + 2] == "none"


def test_the_summary_is_json_with_none_for_what_is_not_defined(pair: dict[str, RunData]) -> None:
    made = summary(compare(pair))
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    carry = made["runs"]["pid"]["phases"][1]
    assert carry["name"] == "carry"
    assert carry["tools"]["arm_a"]["step_length"] == pytest.approx(0.2, rel=1e-3)
    assert carry["tools"]["arm_a"]["motion"] == "step"
    assert made["runs"]["pid"]["phases"][0]["tools"]["arm_b"]["overshoot"] is None
    assert made["runs"]["pid"]["torque"]["arm_b_joint_1"]["peak"] == pytest.approx(2.0)
    assert made["runs"]["nmpc"]["grasp_events"][1]["command"]["action"] == "transfer"
    assert [claim["holds"] for claim in made["claims"]] == [True] * 6


def test_a_run_cut_short_is_shown_as_far_as_it_went() -> None:
    table = comparison_table({"nmpc": run_of(Law(end=20.02)), "pid": run_of(replace(BAD, end=0.0))})
    assert "Phase carry, 20 to 20.02 s" in table
    assert "DOES NOT HOLD: Both laws complete the handover" in table


def test_runs_of_the_simulation_can_be_compared() -> None:
    short = {"common": {"duration": 0.1}}
    runs = {law: simulate(load_scenario("colliding", {**short, "law": law})) for law in ("nmpc", "pid")}
    found = compare(runs)
    for item in found.runs.values():
        assert item.physics.linear_momentum < 1e-9
        assert item.physics.angular_momentum < 1e-9
        assert item.physics.energy < 1e-6
        assert (item.ik.solves, item.ik.failures) == (6, 0)
    assert len(found.claims) == 6


def test_what_keeps_a_tool_from_its_target_is_named() -> None:
    """A row of places that binds in most of the last tenth; rates slow down, a settled tool is there.

    An arm that holds its joints has no target that it could be kept from.
    """
    row, other = "distance arm_b_gripper - deputy", "position of arm_b_joint_6"
    stamps = range(0, 6_000_000_000, 20_000_000)

    def plans(at_end: tuple[str, ...], before: tuple[str, ...]) -> tuple[PlanReport, ...]:
        """Return solves of which the rows ``at_end`` bind in the last tenths of both phases."""
        binds = [(stamp, at_end if stamp % 3_000_000_000 >= 2_700_000_000 else before) for stamp in stamps]
        measured = (0.0, "", 0.0, 0.0, 0.0, 0.0, 0.0)
        return tuple(PlanReport(stamp, 1, PlanStatus.SOLVED, 1, rows, *measured) for stamp, rows in binds)

    target = {"arm_a": still((1.0, 0.0, 0.0)), "arm_b": still((1.0, 0.0, 0.0))}
    drifting = line(lambda t: 1.0 + 0.004 * np.maximum(t - 3.0, 0.0))
    tool = {"arm_a": drifting, "arm_b": line(lambda t: np.minimum(t, 0.957))}
    phases = (("reach", 0.0), ("stay", 3.0))
    given: dict[str, Any] = {"end": 6.0, "phases": phases, "tool": tool, "target": target}
    stuck = make_run(**given, plans=plans((row, "rate of arm_b_joint_1"), (other,)))
    slow = make_run(**given, plans=plans(("rate of arm_b_joint_1",), (row,)))
    found = [(item.phase, item.arm, item.row) for item in measure(stuck).blocked]
    assert found == [("reach", "arm_b", row), ("stay", "arm_b", row)]
    assert measure(slow).blocked == ()
    table = comparison_table({"stuck": stuck, "slow": slow})
    assert re.search(rf"\n  reach, arm_b: {row} +43 +-\n  stay, arm_b: {row} +43 +-\n", table)
    settled = make_run(**{**given, "tool": target}, plans=stuck.plans)
    assert "while a limit binds" not in comparison_table({"settled": settled, "slow": slow})
