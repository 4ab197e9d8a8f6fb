"""The page that plays runs, in a real browser: it shows what was recorded, whole, and without a network."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Page

from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.plan_report import PlannedPaths
from sms_handover.scene.momentum import Momentum
from sms_handover.scene.page import animation_html
from sms_handover.scene.scene import FRAME_RATE, Scene, make_scene
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array

from ..ros.short_handover import short_handover
from .chromium import NARROW, WIDE
from .conftest import Browsing, Visit

pytestmark = pytest.mark.browser

SINGLE = 1e-6  # m; the page has single precision
CONTROLS = ("play", "time", "speed", "view", "runs", "traces", "targets", "nearest", "clock")

Open = Callable[..., Visit]


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Scene]:
    """A short handover under each law."""
    schedule = tmp_path_factory.mktemp("schedule") / "short.yaml"
    schedule.write_text(short_handover(stretch=3.0), encoding="utf-8")
    made = {}
    for law in ("nmpc", "pid"):
        scenario = load_scenario(
            "colliding", {"common": {"schedule": str(schedule)}, "controller": {"law": law}}
        )
        run, truth = simulate(scenario), scenario.truth
        series = run_clearance(run, TaskTexts(truth.robot.urdf, truth.schedule.text)).series
        assert series is not None
        if law == "nmpc":  # as if it had plans
            lines = {arm: run.tool_pose[arm][:4, :3] for arm in run.arms}
            run = replace(run, planned_paths=(PlannedPaths(100_000_000, lines),))
        size, rate = truth.schedule.deputy.size, FRAME_RATE
        made[law] = make_scene(run, truth.robot.urdf, size, rate, series.worst_pair)
    return made


@pytest.fixture
def opened(browsing: Browsing, scenes: dict[str, Scene]) -> Open:
    """Open the page of both runs; at the end of a test no page may have complained or asked for anything."""
    return lambda **options: browsing.open(animation_html(scenes), **options)


def position(page: Page, run: int, body: str) -> Array:
    """Return where the page draws a body, from the matrix it is drawn with."""
    script = f"""() => {{ const run = player.runs[{run}]; run.group.updateMatrixWorld(true);
        return run.bodies[run.body({body!r})].matrixWorld.elements.slice(12, 15) }}"""
    return np.array(page.evaluate(script))


def seek(page: Page, t: float) -> None:
    """Go to a time in s."""
    page.evaluate("t => player.seek(t)", float(t))


def picture(page: Page) -> bytes:
    """Return what the canvas shows."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.locator("#frame").screenshot()


@pytest.mark.parametrize("size", [WIDE, NARROW])
@pytest.mark.parametrize("dark", [False, True])
def test_it_opens_whole_and_without_a_network(opened: Open, size: tuple[int, int], dark: bool) -> None:
    visit = opened(size=size, dark=dark, touch=size is NARROW)
    picture(visit.page)
    assert visit.errors == [] and visit.requests == []
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    for name in CONTROLS:
        box = visit.page.locator(f"#{name}").bounding_box()
        assert box is not None, name
        assert box["x"] >= 0 and box["x"] + box["width"] <= size[0], name
        assert box["y"] + box["height"] <= size[1], name
    frame = visit.page.locator("#frame").bounding_box()
    assert frame is not None and frame["height"] > 0.45 * size[1]


def test_every_body_is_drawn_where_it_was_recorded(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    for run, scene in enumerate(scenes.values()):
        for row in (0, len(scene.stamp_ns) // 3, len(scene.stamp_ns) - 1):
            seek(page, scene.stamp_ns[row] / 1e9)
            for place, link in enumerate(scene.links):
                drawn = position(page, run, link)
                assert np.abs(drawn - scene.link_in_world[row, place, :3]).max() < SINGLE, link
            drawn = position(page, run, "deputy")
            assert np.abs(drawn - scene.deputy_in_world[row, :3]).max() < SINGLE
            for arm, target in scene.target_in_world.items():
                assert np.abs(position(page, run, f"{arm}/target") - target[row, :3]).max() < SINGLE


def test_a_plan_is_drawn_while_it_is_the_latest(opened: Open, scenes: dict[str, Scene]) -> None:
    """A line per arm through its points, of the run that has plans."""
    page, planned = opened().page, scenes["nmpc"].planned
    assert planned is not None and page.locator("#planned").is_visible()
    script = """player.runs[0].planned.lines.map((line) => [line.visible,
        Array.from(line.geometry.attributes.instanceEnd?.data.array ?? [])])"""
    for t, shown in ((0.09, False), (0.1, True), (0.5, True), (0.7, False)):
        seek(page, t)
        for arm, (visible, numbers) in enumerate(page.evaluate(script)):
            assert visible is shown, t
            ends = np.reshape(numbers, (-1, 2, 3))[:, 1] if shown else planned.points[0, arm, 1:]
            assert np.abs(ends - planned.points[0, arm, 1:]).max() < SINGLE
    assert page.evaluate("player.runs[1].planned.times") == []


def test_between_two_instants_a_body_is_on_the_straight_line(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    scene = scenes["pid"]
    row = len(scene.stamp_ns) // 2
    seek(page, (0.25 * scene.stamp_ns[row] + 0.75 * scene.stamp_ns[row + 1]) / 1e9)
    tool = scene.tool("arm_a")[:, :3]
    expected = 0.25 * tool[row] + 0.75 * tool[row + 1]
    assert np.abs(position(page, 1, "arm_a_tool") - expected).max() < SINGLE
    assert np.abs(tool[row] - tool[row + 1]).max() > 10 * SINGLE  # else the test would see nothing


def test_the_picture_shows_the_time(opened: Open) -> None:
    page = opened().page
    first = picture(page)
    assert picture(page) == first
    page.evaluate("player.seek(player.end)")
    last = picture(page)
    assert last != first
    page.evaluate("player.seek(player.start)")
    assert picture(page) == first


def test_it_plays_pauses_and_stops_at_the_end(opened: Open) -> None:
    visit = opened()
    page = visit.page
    page.select_option("#speed", "0.25")
    page.click("#play")
    page.wait_for_function("player.t > player.start")
    page.click("#play")
    stopped = page.evaluate("player.t")
    picture(page)
    assert page.evaluate("player.t") == stopped < page.evaluate("player.end")
    page.select_option("#speed", "10")
    page.keyboard.press("Escape")
    page.locator("#picture").focus()
    page.keyboard.press("Space")
    page.wait_for_function("player.t === player.end && !player.playing")
    assert visit.errors == []


def test_the_bar_leads_through_time_and_phases(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    page.locator("#time").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("player.t") == pytest.approx(0.1)
    phases = scenes["nmpc"].phases
    assert page.locator("#phases button").all_inner_texts() == [phase.name for phase in phases]
    for phase in phases:
        page.get_by_title(f"{phase.name}, from").click()
        assert page.evaluate("player.t") == pytest.approx(phase.stamp_ns / 1e9)
        assert page.locator("#readout h1").inner_text() == phase.name
        assert page.locator("#phases button.now").inner_text() == phase.name


def test_the_error_read_out_is_that_of_the_run(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    row = len(next(iter(scenes.values())).stamp_ns) // 2
    seek(page, scenes["nmpc"].stamp_ns[row] / 1e9)
    shown = page.locator("#readout tbody tr").first.locator("td").all_inner_texts()
    expected = []
    for scene in scenes.values():
        error = scene.tool("arm_a")[row, :3] - scene.target_in_world["arm_a"][row, :3]
        expected.append(f"{1000 * float(np.linalg.norm(error)):.1f} mm")
    assert shown == expected


def test_what_came_of_a_grasp_is_told(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    event = scenes["nmpc"].grasp_events[0]
    seek(page, event.stamp_ns / 1e9)
    assert f"{event.command.arm} takes {event.command.grasp_frame}" in page.locator("#event").inner_text()
    assert event.status.value in page.locator("#event").inner_text()


def test_runs_can_be_put_over_each_other_side_by_side_or_alone(opened: Open) -> None:
    visit = opened()
    page = visit.page
    options = page.locator("#runs option").all_inner_texts()
    assert options == ["nmpc over pid", "side by side", "nmpc", "pid"]
    seen = set()
    for option in options:
        page.select_option("#runs", label=option)
        seen.add(picture(page))
    assert len(seen) == len(options)
    assert visit.errors == []


def test_a_drag_turns_the_camera_and_moves_nothing(opened: Open, scenes: dict[str, Scene]) -> None:
    page = opened().page
    before = position(page, 0, "arm_b_tool")
    first = picture(page)
    box = page.locator("#picture").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 300)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 350, steps=4)
    page.mouse.up()
    assert picture(page) != first
    assert np.array_equal(position(page, 0, "arm_b_tool"), before)


def test_in_a_frame_it_tells_and_takes_the_time(browsing: Browsing, scenes: dict[str, Scene]) -> None:
    outside = """<!DOCTYPE html><html lang="en"><title>outside</title><link rel="icon" href="data:,">
        <iframe id="inside" style="width: 900px; height: 600px"></iframe>
        <script>window.heard = []; addEventListener("message", (event) => heard.push(event.data));</script>"""
    visit = browsing.open(outside)
    page = visit.page
    page.evaluate("html => { inside.srcdoc = html; }", animation_html(scenes))
    page.wait_for_function("heard.length > 0")
    inside = page.frames[1]
    inside.evaluate("player.seek(0.25)")
    page.wait_for_function("heard.at(-1).t === 0.25 && heard.at(-1).type === 'time'")
    count = page.evaluate("heard.length")
    page.evaluate("inside.contentWindow.postMessage({ type: 'time', t: 0.5 }, '*')")
    inside.wait_for_function("player.t === 0.5")
    page.evaluate("inside.contentWindow.postMessage({ type: 'theme', theme: 'dark' }, '*')")
    inside.wait_for_function("player.theme === 'dark'")
    for nonsense in ("null", "'time'", "{ type: 'time', t: 'soon' }", "{ type: 'other' }"):
        page.evaluate(f"inside.contentWindow.postMessage({nonsense}, '*')")
    page.evaluate("inside.contentWindow.postMessage({ type: 'time', t: 0.75 }, '*')")
    inside.wait_for_function("player.t === 0.75")
    inside.evaluate("window.postMessage({ type: 'time', t: 0.9 }, '*')")  # not from the page around it
    page.evaluate("inside.contentWindow.postMessage({ type: 'theme', theme: 'light' }, '*')")
    inside.wait_for_function("player.theme === 'light'")
    assert inside.evaluate("player.t") == 0.75
    assert page.evaluate("heard.length") == count  # it does not tell what it was told
    assert visit.errors == [] and visit.requests == []


def test_a_name_is_text_whatever_it_holds(browsing: Browsing, scenes: dict[str, Scene]) -> None:
    name = "</script><script>window.broken = 1</script><b>&amp;{{three}}"
    visit = browsing.open(animation_html({name: scenes["pid"]}, title=name))
    assert visit.page.locator("#readout small").inner_text() == name
    assert visit.page.title() == name
    assert visit.page.evaluate("window.broken") is None
    assert visit.errors == []


def test_it_says_so_where_there_is_no_3d(opened: Open) -> None:
    page = opened(before="HTMLCanvasElement.prototype.getContext = () => null").page
    assert "cannot draw the 3D view" in page.locator("#trouble").inner_text()


def test_what_was_not_recorded_is_not_drawn(browsing: Browsing, scenes: dict[str, Scene]) -> None:
    scene = scenes["nmpc"]
    gone = scene.deputy_in_world.copy()
    gone[3:] = np.nan
    visit = browsing.open(animation_html({"gap": replace(scene, deputy_in_world=gone)}))
    visible = "player.runs[0].bodies[player.runs[0].body('deputy')].visible"
    assert visit.page.evaluate(visible)
    visit.page.evaluate("player.seek(player.end)")
    picture(visit.page)
    assert not visit.page.evaluate(visible)
    assert visit.errors == []


def test_momentum_is_an_arrow_at_the_centre_of_mass(browsing: Browsing, scenes: dict[str, Scene]) -> None:
    """Its size is told; a run without momentum has neither arrow nor box to tick."""
    scene = scenes["nmpc"]
    angular = np.tile([0.3, 0.0, -0.4], (len(scene.stamp_ns), 1))
    centres = np.linspace([0.0, 0.0, 0.1], [0.1, 0.0, 0.1], len(scene.stamp_ns))
    visit = browsing.open(animation_html({"spins": replace(scene, momentum=Momentum(centres, angular))}))
    page = visit.page
    seek(page, scene.stamp_ns[-1] / 1e9)
    drawn = np.array(
        page.evaluate("['ball', 'head'].map((part) => player.runs[0].momentum[part].position.toArray())")
    )
    assert np.abs(drawn[0] - centres[-1]).max() < SINGLE
    way = drawn[1] - drawn[0]
    assert np.abs(way / np.linalg.norm(way) - [0.6, 0.0, -0.8]).max() < SINGLE
    assert "0.500 kg m\u00b2/s" in page.locator("#readout").inner_text()
    shown = picture(page)
    page.locator("#momentum").uncheck()
    assert picture(page) != shown and visit.errors == []
    plain = browsing.open(animation_html({"rests": scene}))
    assert not plain.page.locator("#momentum").is_visible() and plain.errors == []


def test_the_nearest_bodies_are_marked_and_red_where_they_are_in_each_other(
    browsing: Browsing, scenes: dict[str, Scene]
) -> None:
    """Two instants of a made-up course: 12.3 mm apart, then 6.8 mm in each other."""
    scene = scenes["pid"]
    assert scene.worst_pair is not None
    distance = scene.worst_pair.distance.copy()
    distance[0], distance[1:] = 0.0123, -0.0068
    marked = replace(scene, worst_pair=replace(scene.worst_pair, distance=distance))
    visit = browsing.open(animation_html({"pid": marked}), size=NARROW)
    page, label = visit.page, visit.page.locator("#labels .distance")
    red = "player.runs[0].nearest.line.material.color.r > 2 * player.runs[0].nearest.line.material.color.b"
    for row, text in ((0, "12.3 mm"), (len(distance) - 1, "\u22126.8 mm")):
        seek(page, scene.stamp_ns[row] / 1e9)
        without = picture(page)
        ends = np.array(page.evaluate("player.runs[0].nearest.ends.map((end) => end.position.toArray())"))
        assert np.abs(ends - scene.worst_pair.points_in_world[row]).max() < SINGLE
        names = " - ".join(scene.worst_pair.bodies[scene.worst_pair.pair[row]])
        assert label.inner_text() == f"{names}: {text}"
        assert text in page.locator("#readout").inner_text()
        assert page.evaluate(red) is (row > 0)
        box = label.bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= NARROW[0]
        page.locator("#nearest").uncheck()
        assert picture(page) != without and not label.is_visible()
        page.locator("#nearest").check()
    assert visit.errors == []
    plain = browsing.open(animation_html({"pid": replace(scene, worst_pair=None)}))
    assert not plain.page.locator("#nearest").is_visible() and plain.errors == []
