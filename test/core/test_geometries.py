"""The shipped handovers are possible under both laws, and so is what the search calls possible."""

import json
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from docs import geometry_trial
from docs.geometries import Row, grown, page
from docs.geometry_candidates import (
    APPROACH,
    CARRY,
    ORIGIN,
    Geometry,
    design_of,
    drawn,
    resolved,
    schedule_text,
)
from docs.geometry_margins import Variation, varied_robot
from docs.geometry_trial import Bench, _Watch
from docs.measurement_folder import KeptRows
from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.analysis.joint_limits import limit_use
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.configuration.package_files import config_file
from sms_handover.ik.levenberg_marquardt import find_joints
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus, IkRequest
from sms_handover.units import NS_PER_S

LEAST = {"paper": 0.001, "smooth": 0.02}  # m, outside declared contacts


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


@pytest.fixture(scope="module")
def geometry(bench: Bench) -> Geometry:
    """The first geometry in reach."""
    random = np.random.default_rng(16)
    for _ in range(1000):
        found = resolved(drawn(random), bench.robot, bench.ik)
        if isinstance(found, Geometry):
            return found
    raise AssertionError("no geometry in reach")


@pytest.mark.parametrize("law", ["nmpc", "pid"])
@pytest.mark.parametrize("name", LEAST)
def test_nothing_touches_in_the_shipped_handovers(name: str, law: str) -> None:
    scenario = load_scenario(name, {"common.dynamics": "compiled", "law": law})
    run = simulate(scenario)
    robot = scenario.truth.robot
    found = run_clearance(run, TaskTexts(robot.urdf, scenario.truth.schedule.text))
    assert not found.collisions
    assert min(group.least for group in found.groups if group.allowed == 0.0) >= LEAST[name]
    limits = limit_use(run, robot.pin)
    assert limits.kept
    assert limits.rate.value < 0.9
    assert [event.status for event in run.grasp_events] == [GraspStatus.SUCCEEDED] * 2


def test_a_run_ends_where_the_first_bodies_touch(bench: Bench) -> None:
    text = config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
    attempt = bench.attempt(bench.schedule(text), "nmpc")
    assert (attempt.phase, attempt.failure) == (APPROACH, "gripper arm_a - deputy")
    assert attempt.least == pytest.approx(0.0, abs=2e-3)  # m in one reference period at 0.1 m/s
    assert attempt.run is None


def test_a_joint_beyond_its_limit_is_found_in_the_phase_in_which_it_is(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit is one that the joint passes while it carries, and it comes back before the end."""
    schedule = bench.schedule(load_scenario("paper").truth.schedule.text)
    run = bench.attempt(schedule, "nmpc").run
    assert run is not None
    approach, withdraw = (run.tick_ns < 20 * NS_PER_S), (run.tick_ns > 55 * NS_PER_S)
    joints = run.joint_position
    within = np.maximum(joints[approach].max(axis=0), joints[withdraw].max(axis=0))
    beyond = joints.max(axis=0) - within
    narrow = copy(bench.robot)
    narrow.upper = np.where(beyond == beyond.max(), within + 0.5 * beyond, bench.robot.upper)
    assert beyond.max() > 0.01  # rad
    monkeypatch.setattr(geometry_trial, "_Watch", lambda bodies, robot, *rest: _Watch(bodies, narrow, *rest))
    attempt = bench.attempt(schedule, "nmpc")
    assert (attempt.phase, attempt.failure, attempt.run) == (CARRY, "position limit", None)


def test_a_geometry_is_the_same_after_its_file(bench: Bench, geometry: Geometry) -> None:
    text = schedule_text(geometry)
    again = resolved(design_of(bench.schedule(text), bench.robot, bench.ik), bench.robot, bench.ik)
    assert isinstance(again, Geometry)
    assert schedule_text(again) == text


def test_a_sweep_is_the_shortest_way_and_keeps_the_tool_in_its_plane(
    bench: Bench, geometry: Geometry
) -> None:
    pure = replace(geometry.design, sweep_a=np.array([0.5, *np.zeros(6)]))
    found = resolved(pure, bench.robot, bench.ik)
    assert isinstance(found, Geometry)
    start, grasp, *_ = found.rests
    part = bench.robot.arm_joints["arm_a"]
    assert np.flatnonzero(np.abs(grasp - start)[part] > 1e-4).tolist() == [0, 6]
    plane = [
        bench.robot.tools_in_world(ORIGIN, start + share * (grasp - start))["arm_a"].position[0]
        for share in (0.0, 0.5, 1.0, 1.4)
    ]
    assert np.ptp(plane) < 1e-3  # m
    request = IkRequest(ORIGIN, start, {"arm_a": bench.robot.tools_in_world(ORIGIN, grasp)["arm_a"]})
    assert find_joints(bench.robot, request, bench.ik).joint_position == pytest.approx(grasp, abs=0.02)


def test_a_deputy_in_the_way_collides_in_the_phase_in_which_it_is(bench: Bench, geometry: Geometry) -> None:
    tool = bench.robot.tools_in_world(ORIGIN, geometry.rests[0])["arm_b"]
    assert bench.collides(replace(geometry, deputy_in_world=tool)) == APPROACH


def test_variations_change_masses_and_inertias_alone(bench: Bench) -> None:
    robot = bench.robot.description
    heavier = varied_robot(robot, Variation("", base=1.05, arms=0.95))
    assert heavier.base.inertia.mass == pytest.approx(1.05 * robot.base.inertia.mass)
    assert heavier.base.size == robot.base.size
    for arm, other in zip(robot.arms, heavier.arms, strict=True):
        for link, varied_link in zip(arm.links, other.links, strict=True):
            assert varied_link.inertia.mass == pytest.approx(0.95 * link.inertia.mass)
            assert varied_link.inertia.moments == pytest.approx(
                [0.95 * value for value in link.inertia.moments]
            )
            assert varied_link.inertia.com == link.inertia.com
        assert other.gripper.mass == pytest.approx(0.95 * arm.gripper.mass)
        assert other.joints == arm.joints


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (10, 10, 0.7225, 1.0), (81, 263, 0.2553, 0.3662)],
)
def test_intervals_are_wilson_s(successes: int, trials: int, low: float, high: float) -> None:
    """Newcombe 1998, table I, has the last one."""
    assert proportion(successes, trials)[2:] == pytest.approx((low, high), abs=5e-5)


def row(index: int, *, settling: bool) -> Row:
    claims = {"completion": True, "settling": settling}
    return Row(index, claims, {"nmpc": 1.0 + index, "pid": 1.5}, 0.5, 0.002, 0.6, 3, {"carry: rate limit": 2})


def test_rows_that_are_there_are_not_worked_out_again(tmp_path: Path) -> None:
    rows = [row(0, settling=True), row(1, settling=False)]
    lines = "".join(json.dumps(vars(item)) + "\n" for item in rows)
    file = tmp_path / "rows_3.jsonl"
    file.write_text(lines + '{"index": 2', encoding="utf-8")  # as one that was killed leaves it
    assert grown(3, 2, tmp_path) == rows and grown(3, 1, tmp_path) == rows[:1]
    kept = KeptRows(file)
    kept.add(vars(row(2, settling=True)))
    assert [Row(**one) for one in KeptRows(file).rows] == [*rows, row(2, settling=True)]


def test_the_page_counts_what_holds() -> None:
    text = page([row(0, settling=True), row(1, settling=False)], 3)
    assert "--seed 3 --count 2" in text
    assert "| settling | 1 of 2 | 50 % | 9 % to 91 % |" in text
    assert "All six hold in 1 of 2, 50 % (9 % to 91 %)" in text
    assert "| carry: rate limit | 4 |" in text
