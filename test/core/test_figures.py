"""What the figures show is the data of the runs, whole, marked and legible."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sms_handover.analysis.figure_catalogue import FIGURES, FigureKind, chosen_figures
from sms_handover.analysis.figures.draw import draw_figures
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.panels import POINTS
from sms_handover.analysis.figures.style import COLUMN, PAGE, line_style
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.run_data import RunData, Stamps
from sms_handover.scene.scene import make_scene
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, GraspStatus

from .conftest import SCHEDULE
from .figure_runs import blank, lines_of, named, texts_of
from .test_analysis_runs import changed

DEG = 180.0 / np.pi
MM = 1000.0


def short(law: str, folder: Path) -> Scenario:
    """Return a handover of 1.4 s under a law."""
    path = folder / f"{law}.yaml"
    path.write_text(SCHEDULE, encoding="utf-8")
    return load_scenario("colliding", {"common": {"schedule": str(path)}, "controller": {"law": law}})


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    return short("nmpc", tmp_path_factory.mktemp("schedules"))


@pytest.fixture(scope="module")
def nmpc(scenario: Scenario) -> RunData:
    return simulate(scenario)


@pytest.fixture(scope="module")
def pid(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    return simulate(short("pid", tmp_path_factory.mktemp("schedules")))


@pytest.fixture(scope="module")
def drawn(scenario: Scenario, nmpc: RunData) -> DrawnRun:
    """The run under NMPC with its scene."""
    scene = make_scene(nmpc, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size, 50.0)
    return DrawnRun("NMPC", nmpc, scene)


def figure_of(name: str, runs: Sequence[DrawnRun], part: str = "") -> Figure:
    """Return one figure of a kind."""
    return dict(draw_figures(runs, [name]))[f"{name}{part}"]


def assert_shows(lines: dict[str, Array], identity: str, stamps: Stamps, values: Array) -> None:
    assert lines[identity][0] == pytest.approx(stamps / 1e9)
    assert lines[identity][1] == pytest.approx(values, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_the_tool_error_is_that_of_every_run(nmpc: RunData, pid: RunData, arm: str) -> None:
    runs = named([nmpc, pid])
    lines = lines_of(figure_of("tool_error", runs, f"_{arm}"))
    assert len(lines) == 2 * 5
    for run in runs:
        tool, target = run.data.tool_pose[arm], run.data.target_pose[arm]
        error = tool[:, :3] - target[:, :3]
        stamps = run.data.reference_ns
        for axis in range(3):
            assert_shows(lines, f"{run.name}/{arm}/position_error/{axis}", stamps, error[:, axis])
        size = MM * np.linalg.norm(error, axis=1)
        assert_shows(lines, f"{run.name}/{arm}/position_error/None", stamps, size)
        angle = [
            np.linalg.norm(pin.log3(pin.Quaternion(a).matrix().T @ pin.Quaternion(b).matrix()))
            for a, b in zip(target[:, 3:], tool[:, 3:], strict=True)
        ]
        found = lines[f"{run.name}/{arm}/orientation_error/None"][1]
        assert found == pytest.approx(DEG * np.array(angle), rel=1e-6, abs=1e-5)


def test_the_base_is_shown_from_its_start_in_mm_and_degrees(nmpc: RunData, pid: RunData) -> None:
    runs = named([nmpc, pid])
    lines = lines_of(figure_of("base", runs))
    assert len(lines) == 2 * 6
    for run in runs:
        pose, stamps = run.data.base_pose, run.data.tick_ns
        start = pin.Quaternion(pose[0, 3:]).matrix()
        turns = np.array([pin.log3(pin.Quaternion(row).matrix() @ start.T) for row in pose[:, 3:]])
        for axis in range(3):
            place = MM * (pose[:, axis] - pose[0, axis])
            assert_shows(lines, f"{run.name}/base_displacement/{axis}", stamps, place)
            assert_shows(lines, f"{run.name}/base_rotation/{axis}", stamps, DEG * turns[:, axis])


@pytest.mark.parametrize(("arm", "joints"), [("arm_a", slice(0, 7)), ("arm_b", slice(7, 14))])
def test_joint_errors_and_torques_are_those_of_the_arm(nmpc: RunData, arm: str, joints: slice) -> None:
    errors = lines_of(figure_of("joint_error", named([nmpc]), f"_{arm}"))
    torques = lines_of(figure_of("torque", named([nmpc]), f"_{arm}"))
    at_reference = np.isin(nmpc.tick_ns, nmpc.reference_ns)
    error = DEG * (nmpc.joint_position[at_reference] - nmpc.reference_position)[:, joints]
    torque = nmpc.joint_effort[:, joints]
    for joint in range(7):
        assert_shows(errors, f"run_1/{arm}/joint_error/{joint}", nmpc.reference_ns, error[:, joint])
        assert_shows(torques, f"run_1/{arm}/joint_torque/{joint}", nmpc.tick_ns, torque[:, joint])
    size = np.sqrt(np.sum(torque**2, axis=1))
    assert_shows(torques, f"run_1/{arm}/joint_torque/None", nmpc.tick_ns, size)
    assert len(errors) == len(torques) == 8


def test_the_conserved_are_shown_as_lengths(nmpc: RunData) -> None:
    lines = lines_of(figure_of("momentum", named([nmpc])))
    for name, values in (("linear", nmpc.linear_momentum), ("angular", nmpc.angular_momentum)):
        size = np.sqrt(np.sum((values - values[0]) ** 2, axis=1))
        assert lines[f"run_1/{name}_momentum_change/None"][1] == pytest.approx(size)
    balance = nmpc.kinetic_energy - nmpc.work
    assert lines["run_1/energy_residual/None"][1] == pytest.approx(np.abs(balance - balance[0]))


def test_the_path_of_the_base_is_its_positions(nmpc: RunData) -> None:
    shown = lines_of(figure_of("base_path", named([nmpc])))["run_1/base_displacement"].T
    assert shown == pytest.approx(MM * (nmpc.base_pose[:, :3] - nmpc.base_pose[0, :3]))


def test_a_long_series_is_thinned_and_keeps_its_peaks(nmpc: RunData) -> None:
    effort = np.repeat(nmpc.joint_effort, 5, axis=0)
    effort[3333, 2] = 77.0
    ticks = np.arange(len(effort)) * 280_000
    long = changed(
        nmpc,
        tick_ns=ticks,
        joint_effort=effort,
        **{
            name: np.repeat(getattr(nmpc, name), 5, axis=0)
            for name in ("joint_position", "joint_velocity", "joint_command", "base_pose", "base_twist")
        },
    )
    time, torque = lines_of(figure_of("torque", named([long]), "_arm_a"))["run_1/arm_a/joint_torque/2"]
    assert len(time) <= POINTS < len(effort)
    rows = np.searchsorted(ticks, np.round(time * 1e9))
    assert np.array_equal(torque, effort[rows, 2])
    assert torque.max() == 77.0


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("name", [kind.name for kind in FIGURES if kind.name != "snapshots"])
def test_any_number_of_runs_is_laid_over_each_other(
    nmpc: RunData, pid: RunData, name: str, count: int
) -> None:
    runs = named([nmpc, pid, nmpc][:count])
    for _, figure in draw_figures(runs, [name]):
        identities = list(lines_of(figure))
        per_run = [sum(item.startswith(f"{run.name}/") for item in identities) for run in runs]
        assert len(set(per_run)) == 1 and sum(per_run) == len(identities) > 0
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()][:count] == [run.name for run in runs]


def test_the_first_run_is_solid_the_second_dashed_and_35_differ() -> None:
    looks = [line_style(place) for place in range(35)]
    assert looks[0]["linestyle"] == "-"
    assert looks[1]["linestyle"] != "-"
    assert len({(look["color"], str(look["linestyle"])) for look in looks}) == 35


def test_neighbouring_runs_differ_in_lightness_for_those_who_see_no_colour() -> None:
    """The relative luminance of WCAG 2 or the pattern tells them apart: the pattern always does."""
    for a, b in pairwise(line_style(place) for place in range(35)):
        assert str(a["linestyle"]) != str(b["linestyle"])
        assert to_rgb(a["color"]) != to_rgb(b["color"])


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("momentum", "linear_momentum"),
        ("base", "base_pose"),
        ("torque", "joint_effort"),
        ("joint_error", "reference_position"),
    ],
)
def test_what_was_not_recorded_is_said_and_the_rest_is_drawn(nmpc: RunData, name: str, lost: str) -> None:
    runs = named([nmpc, blank(nmpc, lost)])
    for _, figure in draw_figures(runs, [name]):
        whole = lines_of(next(iter(dict(draw_figures(runs[:1], [name])).values())))
        assert len([item for item in lines_of(figure) if item.startswith("run_1/")]) == len(whole)
        assert "not recorded: run_2" in texts_of(figure)
    for _, figure in draw_figures(runs[1:], [name]):
        assert "not recorded" in texts_of(figure)


def test_a_run_without_any_pose_of_the_base_has_no_path(nmpc: RunData) -> None:
    figure = figure_of("base_path", named([blank(nmpc, "base_pose"), nmpc]))
    lines = lines_of(figure)
    assert lines["run_1/base_displacement"].shape[1] == 0
    assert lines["run_2/base_displacement"].shape[1] == len(nmpc.tick_ns)


def test_a_gap_in_the_recording_is_a_gap_in_the_line(nmpc: RunData) -> None:
    effort = np.array(nmpc.joint_effort)
    effort[300:400] = np.nan
    lines = lines_of(figure_of("torque", named([changed(nmpc, joint_effort=effort)]), "_arm_a"))
    assert np.flatnonzero(np.isnan(lines["run_1/arm_a/joint_torque/0"][1])).tolist() == [*range(300, 400)]


def test_phases_and_grasps_are_marked_where_they_are(nmpc: RunData) -> None:
    (event, *_) = nmpc.grasp_events
    assert event.status is GraspStatus.MISSED  # the phases are too short to arrive
    good = replace(event, status=GraspStatus.SUCCEEDED)
    figure = figure_of("base", named([changed(nmpc, grasp_events=(good, *nmpc.grasp_events[1:])), nmpc]))
    top = figure.axes[0]
    words = {text.get_text(): text.xy[0] for text in top.texts}  # type: ignore[attr-defined]
    names = {name: place for name, place in words.items() if "Arm" not in name}
    assert names == pytest.approx({"approach": 0.2, "carry": 0.7, "withdraw": 1.1, "let go": 1.3})
    grasps = {name: place for name, place in words.items() if "Arm" in name}
    assert list(grasps) == [
        "Arm A grasps (failed: run_2)",
        "Arm A to Arm B (failed: run_1, run_2)",
        "Arm B releases (failed: run_1, run_2)",
    ]
    assert list(grasps.values()) == pytest.approx([0.4, 1.0, 1.2])
    for axes in figure.axes:
        assert axes.get_xlim() == pytest.approx((0.0, 1.4))
        marks = {float(np.asarray(line.get_xdata())[0]) for line in axes.lines if not line.get_gid()}
        assert marks == {0.4, 1.0, 1.2}


def drawn_texts(figure: Figure) -> list[Text]:
    """Return every text that is drawn; of the ticks only those within their axis."""
    found = [*figure.texts, *(text for key in figure.legends for text in key.get_texts())]
    for axes in figure.axes:
        found += [*axes.texts, axes.title]
        legend = axes.get_legend()
        found += legend.get_texts() if legend else []
        if not axes.axison:
            continue
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            found += [axis.label, *(tick.label1 for tick in ticks)]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


FLAT = [kind.name for kind in FIGURES if kind.name != "base_path"]  # boxes around leaning words say little


@pytest.mark.parametrize("name", FLAT)
def test_no_text_covers_another_or_leaves_the_figure(
    nmpc_run: RunData, pid_run: RunData, scenario: Scenario, name: str
) -> None:
    """Of the whole handover, as printed."""
    scene = make_scene(nmpc_run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size, 1.0)
    assert_legible([DrawnRun("NMPC", nmpc_run, scene), DrawnRun("PID", pid_run)], name)


@pytest.mark.parametrize("name", ["tool_error", "torque", "momentum", "snapshots"])
def test_words_of_short_phases_and_failed_grasps_find_room(drawn: DrawnRun, name: str) -> None:
    assert_legible([drawn, *named([drawn.data] * 2)], name)


def assert_legible(runs: Sequence[DrawnRun], name: str) -> None:
    """Every text is within the figure and free of every other."""
    for _, figure in draw_figures(runs, [name]):
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        width, height = canvas.get_width_height()
        boxes = [
            (text.get_text(), text.get_window_extent(canvas.get_renderer()).get_points())
            for text in drawn_texts(figure)
        ]
        assert len(boxes) > 10
        for words, (low, high) in boxes:
            assert np.all(low >= 0.0) and high[0] <= width and high[1] <= height, (
                f"{words!r} leaves the figure"
            )
        for (a_words, a), (b_words, b) in combinations(boxes, 2):
            apart = np.any(a[1] <= b[0] + 1.0) or np.any(b[1] <= a[0] + 1.0)  # [dot] touching is allowed
            assert apart, f"{a_words!r} and {b_words!r} overlap"


@pytest.mark.parametrize("kind", FIGURES)
def test_every_kind_is_drawn_in_the_width_of_a_column_or_a_page(drawn: DrawnRun, kind: FigureKind) -> None:
    figures = dict(draw_figures([drawn], [kind.name]))
    assert figures
    for figure in figures.values():
        assert figure.get_size_inches()[0] in (COLUMN, PAGE)
        assert figure.get_size_inches()[1] < 9.0  # [in] of a page


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (40.0, 1.0, 1.0), (1.0, 1.0, 40.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("count", [1, 9])
def test_a_path_of_any_shape_is_drawn_to_scale_within_the_figure(
    nmpc: RunData, stretch: tuple[float, float, float], count: int
) -> None:
    pose = np.array(nmpc.base_pose)
    pose[:, :3] = pose[0, :3] + (pose[:, :3] - pose[0, :3]) * np.array(stretch)
    figure = figure_of("base_path", named([changed(nmpc, base_pose=pose)] * count))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (axes,) = figure.axes
    assert isinstance(axes, Axes3D)
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    scale = np.diff(limits, axis=1)[:, 0] / axes.get_box_aspect()
    assert scale == pytest.approx(scale[0])
    place = pose[:, :3] - pose[0, :3]
    assert np.all(limits[:, 0] < MM * place.min(axis=0)) and np.all(MM * place.max(axis=0) < limits[:, 1])
    width, height = canvas.get_width_height()
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        box = axis.get_tightbbox(canvas.get_renderer())
        assert box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= width
        assert box.y1 <= height - figure.legends[0].get_window_extent(canvas.get_renderer()).height


def test_all_figures_come_in_the_order_of_the_catalogue(drawn: DrawnRun) -> None:
    assert [name for name, _ in draw_figures([drawn])] == [
        *("tool_error_arm_a", "tool_error_arm_b", "base", "joint_error_arm_a", "joint_error_arm_b"),
        *("torque_arm_a", "torque_arm_b", "momentum", "base_path", "snapshots_NMPC"),
    ]


def test_a_run_without_a_scene_has_no_snapshots(drawn: DrawnRun, nmpc: RunData) -> None:
    names = [name for name, _ in draw_figures([drawn, DrawnRun("other", nmpc)], ["snapshots"])]
    assert names == ["snapshots_NMPC"]


def test_names_are_checked() -> None:
    assert [kind.name for kind in chosen_figures(["torque", "base", "torque"])] == ["base", "torque"]
    with pytest.raises(UnknownNameError, match="unknown figure 'torques' \\(did you mean 'torque'\\?\\)"):
        chosen_figures(["torques"])


def test_runs_are_checked(nmpc: RunData) -> None:
    with pytest.raises(ConfigurationError, match="there is no run to draw"):
        next(draw_figures([]))
    twice = [DrawnRun("one", nmpc), DrawnRun("one", nmpc)]
    with pytest.raises(ConfigurationError, match="runs must have different names, these are one, one"):
        next(draw_figures(twice))
