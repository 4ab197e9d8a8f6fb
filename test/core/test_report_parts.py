"""The parts of a report: looks of runs, marked figures, provenance, thinned plots, the policy of the page."""

import json
from base64 import b64decode, b64encode
from hashlib import sha256
from math import nan
from pathlib import Path

import numpy as np
import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.highlights import highlights
from sms_handover.analysis.layout import row
from sms_handover.analysis.signals import signals_of
from sms_handover.bag.info import BagInfo, read_info
from sms_handover.report.page_data import packed, page_data
from sms_handover.report.plots import POINTS, TRANSIENT_S, plot_groups, thin
from sms_handover.report.provenance import (
    EVERY_NODE,
    NOT_RECORDED,
    compared_parameters,
    compared_versions,
    schedule_difference,
)
from sms_handover.report.security import content_security_policy, inline_scripts
from sms_handover.report.styles import COLOURS, DASHES, run_styles
from sms_handover.run_data import RunData
from sms_handover.types import GraspAction, GraspStatus

from .bag_messages import made_up_run
from .report_bags import write_bag
from .test_analysis_runs import ARMS, NS, changed, grasp, line, make_run, still


@pytest.mark.parametrize(
    ("values", "missing", "better"),
    [
        ((1.0, 2.0), "-", {0}),
        ((2.0, 1.0), "-", {1}),
        ((1.0, 1.00001), "-", set()),  # the same in four digits
        ((1.0, nan), "-", set()),  # not recorded: nothing to compare with
        ((1.0, nan), "never", {0}),
        ((nan, nan), "never", set()),
        ((None, 3.0, 2.0), "-", {2}),
        ((3.4, nan, 3.4), "never", {0, 2}),
        ((5.0,), "-", set()),
    ],
)
def test_the_smallest_cost_is_the_better_one(
    values: tuple[float | None, ...], missing: str, better: set[int]
) -> None:
    def same(value: float) -> float:
        return value

    assert row("cost", values, same, missing, smaller_is_better=True).better == better
    assert row("no cost", values, same, missing).better == set()


def test_highlights_are_the_worst_of_all_phases_and_arms() -> None:
    """The tools stand off their targets by known distances, so the worst is known."""
    away = {"arm_a": still((0.004, 0.0, 0.0)), "arm_b": still((0.0, 0.007, 0.0))}
    near = {"arm_a": line(lambda t: 0.002 + 0.0 * t), "arm_b": still()}
    events = [grasp(20.0), grasp(40.0, GraspAction.TRANSFER, "arm_b", "arm_a", GraspStatus.MISSED)]
    comparison = compare({"far": make_run(tool=away, events=events), "near": make_run(tool=near)})
    rows = {item.label: item for item in highlights(comparison).rows}
    assert rows["largest final error [mm]"].cells == ("7", "2")
    assert rows["largest final error [mm]"].better == {1}
    assert rows["grasp commands that succeeded"].cells == ("1 of 2", "0 of 0")
    assert rows["largest distance at a grasp [mm]"].cells == ("4", "-")


def test_a_tool_that_never_settles_in_one_phase_has_no_longest_settling_time() -> None:
    """The first phase is an exponential that settles; later the tool stays 2 mm away, out of its band."""
    late = {"arm_a": line(lambda t: np.where(t < 20.0, 0.05 * np.exp(-t), 0.002))}
    settled = {"arm_a": line(lambda t: np.where(t < 20.0, 0.05 * np.exp(-t), 0.0))}
    comparison = compare({"late": make_run(tool=late), "settled": make_run(tool=settled)})
    (times,) = [item for item in highlights(comparison).rows if item.label == "longest settling time [s]"]
    assert times.cells[0] == "never" and times.better == {1}
    assert float(times.cells[1]) == pytest.approx(np.log(50.0), abs=0.02)


def test_nmpc_is_solid_and_pid_is_dashed_wherever_they_stand() -> None:
    for laws in (["nmpc", "pid"], ["pid", "nmpc"], ["pid"], ["other", "pid", "nmpc"]):
        for style in run_styles([f"run {place}" for place in range(len(laws))], laws):
            assert style.dash == {"nmpc": "solid", "pid": "dash"}.get(style.law, style.dash)


def test_many_runs_all_look_different() -> None:
    count = COLOURS * len(DASHES)
    for laws in (["nmpc"] * count, ["pid", "nmpc"] * (count // 2), ["unknown"] * count):
        styles = run_styles([str(place) for place in range(count)], laws)
        assert len({(style.colour, style.dash) for style in styles}) == count
        assert {style.colour for style in styles} == set(range(COLOURS))


@pytest.fixture
def infos(tmp_path: Path) -> list[BagInfo]:
    """Three bags: the second differs in one parameter and its schedule, the third carries nothing."""
    shared: dict[str, object] = {"tick": 0.001, "mode": "lockstep"}
    first = {"plant": {**shared, "folder": "kept"}, "recorder": {**shared, "folder": "/one"}}
    second = {"plant": {**shared, "folder": "other", "new": [1, 2]}, "recorder": {**shared, "folder": "/two"}}
    run = made_up_run(ticks=3)
    described = [("a: 1\nb: 2\n", first), ("a: 1\nb: 3\n", second), (None, None)]
    bags = [
        write_bag(tmp_path / str(number), run, urdf=schedule, schedule=schedule, values=values)
        for number, (schedule, values) in enumerate(described)
    ]
    return [read_info(bag) for bag in bags]


def test_parameters_are_compared_by_node_and_name(infos: list[BagInfo]) -> None:
    found = {(item.group, item.name): item for item in compared_parameters(infos[:2])}
    assert found[EVERY_NODE, "tick"].values == ("0.001", "0.001")
    assert found["plant", "folder"].values == ('"kept"', '"other"')
    assert found["plant", "new"].values == (NOT_RECORDED, "[1, 2]")
    assert {key for key, item in found.items() if item.differs} == {("plant", "folder"), ("plant", "new")}
    assert ("recorder", "folder") not in found  # where a bag was put is no parameter of the run
    assert set(found) == {(EVERY_NODE, "tick"), (EVERY_NODE, "mode"), ("plant", "folder"), ("plant", "new")}


def test_a_bag_that_carries_nothing_differs_in_everything(infos: list[BagInfo]) -> None:
    assert compared_parameters([infos[2]]) == ()
    assert all(item.differs for item in compared_parameters([infos[0], infos[2]]))
    versions = {item.name: item.values for item in compared_versions([infos[0], infos[2]])}
    assert set(versions) == {"robot description", "schedule"}
    assert versions["schedule"][0].startswith("sha256 ") and versions["schedule"][1] == NOT_RECORDED


def test_schedules_are_compared_line_by_line(infos: list[BagInfo]) -> None:
    assert schedule_difference([infos[0], infos[0]], ["x", "y"]) == ""
    difference = schedule_difference(infos[:2], ["x", "y"]).splitlines()
    assert difference[:2] == ["--- x", "+++ y"]
    assert "-b: 2" in difference and "+b: 3" in difference


def test_thinning_keeps_the_extremes_and_the_detail_of_transients() -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    values = np.sin(time) * np.exp(-time)
    values[777] = 5.0
    kept, thinned = thin(time, values, [0.0, TRANSIENT_S])
    assert thinned.max() == 5.0 and thinned.min() == values.min()
    assert np.all(np.diff(kept) > 0) and set(kept) <= set(time)
    assert len(kept) <= 2 * POINTS
    assert np.sum(kept < TRANSIENT_S) > 0.9 * POINTS
    few = np.arange(5.0)
    assert np.array_equal(thin(few, few, [2.0])[0], few)


def test_numbers_survive_their_packing_with_seven_digits() -> None:
    values = np.array([0.0, 1.0 / 3.0, -4e-14, 60.001, nan])
    again = np.frombuffer(b64decode(packed(values)), dtype="<f4")
    assert np.allclose(again[:4], values[:4], rtol=2.0**-23, atol=0.0) and np.isnan(again[4])


def test_plots_draw_the_signals_of_every_run() -> None:
    runs = [made_up_run(seed=1), made_up_run(seed=2)]
    plots = {plot.key: plot for group in plot_groups(runs) for plot in group.plots}
    torque = plots["arm_a/joint_torque"]
    assert torque.series == tuple(f"joint {number}" for number in range(1, 8))
    for drawn in torque.lines:
        expected = signals_of(runs[drawn.run])["arm_a/joint_torque"].values[:, drawn.series]
        assert np.array_equal(drawn.values, expected)
    error = plots["arm_b/position_error"]
    expected = np.linalg.norm(runs[0].tool_pose["arm_b"][:, :3] - runs[0].target_pose["arm_b"][:, :3], axis=1)
    assert [drawn.run for drawn in error.lines] == [0, 1]
    assert np.allclose(error.lines[0].values, 1000.0 * expected, rtol=1e-14)  # mm


def test_what_was_not_recorded_has_no_line() -> None:
    run = made_up_run()
    gone = changed(run, linear_momentum=np.full_like(run.linear_momentum, nan))
    plots = {plot.key: plot for group in plot_groups([gone, run]) for plot in group.plots}
    assert [drawn.run for drawn in plots["linear_momentum"].lines] == [1]
    alone = {plot.key: plot for group in plot_groups([gone]) for plot in group.plots}
    assert alone["linear_momentum"].lines == ()


def test_page_data_are_json_and_tell_where_outcomes_differ() -> None:
    succeeded = make_run(events=[grasp(20.0)])
    missed = make_run(events=[grasp(20.0, status=GraspStatus.MISSED)], end=70.0)
    runs: list[RunData] = [succeeded, missed]
    data = json.loads(json.dumps(page_data(runs, run_styles(["a", "b"], ["nmpc", "pid"]), plot_groups(runs))))
    assert data["span"] == [0.0, 70.0]
    assert data["events"] == [
        {"time": 20.0, "text": f"grasp by {ARMS[0]}: succeeded in a, missed in b", "succeeded": False}
    ]
    assert [phase["begin"] * NS for phase in data["phases"]] == [0.0, 20.0 * NS, 40.0 * NS]


def test_the_policy_names_every_script_and_allows_no_address() -> None:
    scripts = ("let a = '<b>&amp;';", "\nlet b = 1 < 2;\n")
    document = f"<p>script</p><script>{scripts[0]}</script><SCRIPT type='x'>{scripts[1]}</SCRIPT>"
    assert inline_scripts(document) == scripts
    policy = content_security_policy(scripts)
    for script in scripts:
        assert f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" in policy
    assert policy.startswith("default-src 'none'; ")
    assert "http" not in policy and "unsafe-eval" not in policy and "script-src 'unsafe-inline'" not in policy
