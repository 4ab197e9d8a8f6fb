"""Snapshots show the solids of the scene where they are, as a camera would, nearer before farther."""

from itertools import pairwise
from math import pi, radians
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from sms_handover.analysis.figures.draw import draw_figures, write_figure
from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.snapshots import _colour, _pale, draw_snapshots
from sms_handover.analysis.figures.solids import Camera, faces_of, picture_of
from sms_handover.analysis.figures.style import COLOURS
from sms_handover.errors import ConfigurationError
from sms_handover.scene.scene import Scene, make_scene
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array

from .conftest import MakeScenario

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def drawn(make_scenario: MakeScenario) -> DrawnRun:
    scenario = make_scenario()
    run = simulate(scenario)
    return DrawnRun(
        "NMPC", run, make_scene(run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size, 50.0)
    )


def volume(faces: tuple[Array, ...]) -> float:
    """Return the volume that faces enclose, positive if they look outwards: the divergence theorem."""
    total = 0.0
    for face in faces:
        for a, b in pairwise(face[1:]):
            total += float(np.dot(face[0], np.cross(a, b))) / 6.0
    return total


def area_vector(faces: tuple[Array, ...]) -> Array:
    """Return the sum of all area vectors, zero for a surface without holes."""
    fans = [np.cross(a - face[0], b - face[0]) / 2.0 for face in faces for a, b in pairwise(face[1:])]
    return np.asarray(np.sum(fans, axis=0))


@pytest.mark.parametrize("size", [(1.0, 2.0, 0.02), (0.1, 0.34, 0.1), (0.05, 0.05, 0.05)])
def test_the_faces_of_a_box_enclose_it(size: tuple[float, ...]) -> None:
    faces = faces_of("box", size)
    assert volume(faces) == pytest.approx(np.prod(size))
    assert area_vector(faces) == pytest.approx(np.zeros(3), abs=1e-12)
    corners = np.concatenate(faces)
    assert np.ptp(corners, axis=0) == pytest.approx(size)


def test_the_faces_of_a_cylinder_enclose_a_prism_with_its_corners_on_it() -> None:
    radius, length, sides = 0.05, 0.3, 20
    faces = faces_of("cylinder", (radius, length))
    polygon = sides / 2.0 * radius**2 * np.sin(2.0 * pi / sides)  # area of the regular polygon in the circle
    assert volume(faces) == pytest.approx(polygon * length)
    assert area_vector(faces) == pytest.approx(np.zeros(3), abs=1e-12)
    corners = np.concatenate(faces)
    assert np.hypot(corners[:, 0], corners[:, 1]) == pytest.approx(radius)
    assert set(np.round(corners[:, 2], 12)) == {-0.15, 0.15}


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (60.0, 40.0), (-130.0, 75.0)])
def test_a_camera_keeps_lengths_and_the_vertical(azimuth: float, elevation: float) -> None:
    axes = Camera(radians(azimuth), radians(elevation)).axes()
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.cross(axes[0], axes[1]) == pytest.approx(axes[2])
    assert axes[0] @ UP == pytest.approx(0.0, abs=1e-15)  # what is level stays level
    assert axes[1] @ UP >= 0.0


def test_from_the_front_the_picture_is_y_and_z() -> None:
    points = np.array([[1.0, 2.0, 3.0], [9.0, 2.0, 3.0]])
    assert Camera(0.0, 0.0).seen(points) == pytest.approx(np.array([[2.0, 3.0], [2.0, 3.0]]))


def test_only_what_faces_the_camera_is_seen_the_farthest_first() -> None:
    near = [face + [2.0, 0.0, 0.0] for face in faces_of("box", (0.1, 0.1, 0.1))]  # noqa: RUF005
    far = list(faces_of("box", (0.1, 0.1, 0.1)))
    picture = picture_of([near, far], Camera(0.0, 0.0), UP)
    assert picture.solid == (1, 0)  # one face of each; that of the nearer solid covers the other
    assert picture.brightness[0] == picture.brightness[1] < 1.0  # lit from above, seen from the front
    above = picture_of([far], Camera(0.0, radians(90.0)), UP)
    assert above.brightness == pytest.approx(1.0)


def test_the_start_and_two_instants_of_each_phase_are_shown(drawn: DrawnRun) -> None:
    titles = [axes.get_title() for axes in draw_snapshots(drawn).axes]
    assert [title for title in titles if title] == [
        "0 s: start",
        "0.04 s: approach",
        "0.4 s: end of approach",
        "0.48 s: carry",
        "1 s: end of carry",
        "1.02 s: withdraw",
        "1.2 s: end of withdraw",
        "1.22 s: let go",
        "1.4 s: end of let go",
    ]


def test_every_solid_is_drawn_where_the_scene_has_it(drawn: DrawnRun) -> None:
    """The deputy's own colour finds its faces; their middle is the projection of where it is."""
    assert drawn.scene is not None
    deputy = np.array(drawn.scene.deputy_in_world)
    deputy[:, :3] += np.outer(np.arange(len(deputy)), [0.001, -0.004, 0.002])
    scene = Scene(**{**vars(drawn.scene), "deputy_in_world": deputy})
    green = np.array([0x00, 0x9E, 0x73]) / 255.0
    for axes in draw_snapshots(DrawnRun("moving", drawn.data, scene)).axes:
        if not axes.collections:
            continue
        (faces,) = axes.collections
        assert isinstance(faces, PolyCollection)
        colours = np.asarray(faces.get_facecolor())[:, :3]
        own = np.all(np.abs(np.cross(colours, green)) < 1e-9, axis=1)
        paths = [path for path, chosen in zip(faces.get_paths(), own, strict=True) if chosen]
        places = np.concatenate([np.asarray(path.vertices) for path in paths])
        seconds = float(axes.get_title().split(" s:")[0])
        frame = int(np.searchsorted(scene.stamp_ns, round(seconds * 1e9)))
        camera = Camera(radians(60.0), radians(40.0))
        middle = (places.min(axis=0) + places.max(axis=0)) / 2.0
        assert middle == pytest.approx(camera.seen(scene.deputy_in_world[frame, :3]), abs=1e-9)


def test_a_link_has_the_colour_of_its_own_arm(drawn: DrawnRun) -> None:
    assert drawn.scene is not None
    for arms in (("arm", "arm_b"), ("arm_b", "arm")):
        scene = Scene(**{**vars(drawn.scene), "arms": arms})
        colours = [_colour(scene, f"{arm}_link_1", (0.0, 0.0, 0.0)) for arm in arms]
        assert colours == [_pale(colour) for colour in COLOURS[:2]]
        assert _colour(scene, "panel_1", (0.0, 0.0, 0.0)) == _pale((0.0, 0.0, 0.0))
    many = Scene(**{**vars(drawn.scene), "arms": tuple(f"arm_{letter}" for letter in "abcdefgh")})
    assert _pale(COLOURS[2]) not in [_colour(many, f"{arm}_link_1", (0.0, 0.0, 0.0)) for arm in many.arms]


def test_traces_are_the_way_of_each_tool_since_the_picture_before(drawn: DrawnRun) -> None:
    scene = drawn.scene
    assert scene is not None
    figure = draw_snapshots(drawn)
    camera = Camera(radians(60.0), radians(40.0))
    for arm in ("arm_a", "arm_b"):
        ways = [
            np.asarray(line.get_xydata())
            for axes in figure.axes
            for line in axes.lines
            if line.get_gid() == f"{arm}/trace"
        ]
        joined = np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
        assert joined == pytest.approx(camera.seen(scene.tool(arm)[:, :3]))


def test_arms_and_deputy_are_in_every_picture(drawn: DrawnRun) -> None:
    figure = draw_snapshots(drawn)
    for axes in figure.axes:
        for line in axes.lines:
            x, y = np.asarray(line.get_xydata()).T
            assert axes.get_xlim()[0] <= x.min() and x.max() <= axes.get_xlim()[1]
            assert axes.get_ylim()[0] <= y.min() and y.max() <= axes.get_ylim()[1]
    shown = [axes for axes in figure.axes if axes.collections]
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in shown}) == 1


def test_a_deputy_that_was_not_recorded_is_left_out(drawn: DrawnRun) -> None:
    scene = drawn.scene
    assert scene is not None
    lost = Scene(**{**vars(scene), "deputy_in_world": np.full(scene.deputy_in_world.shape, np.nan)})
    figure = draw_snapshots(DrawnRun("NMPC", drawn.data, lost))
    assert len([axes for axes in figure.axes if axes.collections]) == 9


def test_without_phases_there_are_the_first_and_the_last_instant(drawn: DrawnRun) -> None:
    assert drawn.scene is not None
    scene = Scene(**{**vars(drawn.scene), "phases": ()})
    titles = [axes.get_title() for axes in draw_snapshots(DrawnRun("NMPC", drawn.data, scene)).axes]
    assert titles == ["0 s", "1.4 s", "", ""]


def test_snapshots_are_the_same_bytes_each_time(drawn: DrawnRun, tmp_path: Path) -> None:
    for suffix in ("svg", "png"):
        written = []
        for attempt in ("a", "b"):
            ((_, figure),) = draw_figures([drawn], ["snapshots"])
            write_figure(figure, tmp_path / f"{attempt}.{suffix}", 60)
            written.append((tmp_path / f"{attempt}.{suffix}").read_bytes())
        assert written[0] == written[1]


def test_a_run_without_a_scene_is_told(drawn: DrawnRun) -> None:
    with pytest.raises(ConfigurationError, match="run 'other' has no scene, so there are no snapshots of it"):
        draw_snapshots(DrawnRun("other", drawn.data))
