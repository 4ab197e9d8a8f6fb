"""The page that follows a running graph, in a real browser."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from sms_handover.plan_report import PlannedPaths
from sms_handover.run_data import RunData
from sms_handover.scene.live import LiveScene
from sms_handover.scene.scene import Scene, make_scene
from sms_handover.scene.server import SceneServer
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate

from ..core.scene_documents import play
from ..ros.short_handover import short_handover
from .chromium import WIDE
from .conftest import Visit

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    schedule = tmp_path_factory.mktemp("schedule") / "short.yaml"
    schedule.write_text(short_handover(stretch=3.0), encoding="utf-8")
    return load_scenario("colliding", {"common": {"schedule": str(schedule)}})


@pytest.fixture(scope="module")
def run(scenario: Scenario) -> RunData:
    """A run that has two plans, as one under a predictive law: one soon, and one of the last frame."""
    simulated = simulate(scenario)
    last_ns = int(simulated.reference_ns[-1]) // 40_000_000 * 40_000_000
    lines = {arm: poses[:4, :3] for arm, poses in simulated.tool_pose.items()}
    longer = {arm: poses[:6, :3] for arm, poses in simulated.tool_pose.items()}
    return replace(simulated, planned_paths=(PlannedPaths(200_000_000, lines), PlannedPaths(last_ns, longer)))


@pytest.fixture(scope="module")
def scene(scenario: Scenario, run: RunData) -> Scene:
    """The last frame comes too soon after the one before for a live scene to take it, so it is left out."""
    whole = make_scene(run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)
    return replace(
        whole,
        stamp_ns=whole.stamp_ns[:-1],
        link_in_world=whole.link_in_world[:-1],
        deputy_in_world=whole.deputy_in_world[:-1],
        target_in_world={arm: poses[:-1] for arm, poses in whole.target_in_world.items()},
    )


@pytest.fixture
def found(scenario: Scenario) -> list[LiveScene | str]:
    """What the server finds: put a scene into it, or a text."""
    return ["Waiting for the robot"]


@pytest.fixture
def live(scenario: Scenario) -> LiveScene:
    return LiveScene(scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


@pytest.fixture
def visit(browser: Browser, found: list[LiveScene | str]) -> Iterator[Visit]:
    """A page that follows a server."""
    server = SceneServer(lambda: found[0], 0, "live")
    context = browser.new_context(viewport={"width": WIDE[0], "height": WIDE[1]})
    opened = Visit(context.new_page())
    opened.page.goto(server.address)
    yield opened
    context.close()
    server.close()
    assert opened.errors == []
    assert all(url.startswith(server.address) for url in opened.requests)


def wait_until(page: Page, condition: str) -> None:
    page.wait_for_function(f"window.player && ({condition})")


def test_it_waits_then_follows_what_comes(
    visit: Visit, found: list[LiveScene | str], live: LiveScene, run: RunData, scene: Scene
) -> None:
    page = visit.page
    page.get_by_text("Waiting for the robot").wait_for()
    found[0] = live
    page.get_by_text("Waiting for a run to start").wait_for()
    play(live, run, scene, slice(0, 4))
    wait_until(page, f"player.t === {scene.stamp_ns[3] / 1e9}")
    assert page.locator("#trouble").is_hidden() and page.locator("#planned").is_hidden()
    for row in range(4, len(scene.stamp_ns)):
        play(live, run, scene, slice(row, row + 1))
    wait_until(page, f"player.t === {scene.stamp_ns[-1] / 1e9}")
    assert page.evaluate("player.runs[0].motion.count") == len(scene.stamp_ns)
    for place, link in enumerate(scene.links):
        drawn = page.evaluate(f"player.runs[0].position({link!r}).toArray()")
        assert np.abs(np.array(drawn) - scene.link_in_world[-1, place, :3]).max() < 1e-6
    script = """(t) => { player.seek(t); return player.runs[0].planned.lines.map((line) =>
        Array.from(line.geometry.attributes.instanceEnd.data.array)) }"""
    for paths in reversed(run.planned_paths):
        drawn = page.evaluate(script, paths.stamp_ns / 1e9)
        for arm, numbers in zip(scene.arms, drawn, strict=True):
            ends = np.reshape(numbers, (-1, 2, 3))[:, 1]
            np.testing.assert_allclose(ends, paths.tool_in_world[arm][1:], rtol=0.0, atol=1e-6)
    assert page.locator("#planned").is_visible()
    assert page.locator("#phases button").all_inner_texts() == [phase.name for phase in scene.phases]


def test_who_looks_back_is_left_there_while_more_comes(
    visit: Visit, found: list[LiveScene | str], live: LiveScene, run: RunData, scene: Scene
) -> None:
    page = visit.page
    found[0] = live
    play(live, run, scene, slice(0, 10))
    wait_until(page, "player.runs[0].motion.count === 10")
    page.click("#play")
    page.evaluate("player.seek(0.1)")
    play(live, run, scene, slice(10, 20))
    wait_until(page, "player.runs[0].motion.count === 20")
    assert page.evaluate("player.t") == 0.1
    page.select_option("#speed", "10")
    page.click("#play")
    wait_until(page, "player.t === player.end && player.playing")


def test_another_run_begins_anew(
    visit: Visit, found: list[LiveScene | str], live: LiveScene, run: RunData, scene: Scene
) -> None:
    page = visit.page
    found[0] = live
    play(live, run, scene)
    wait_until(page, f"player.runs[0].motion.count === {len(scene.stamp_ns)}")
    play(live, run, scene, slice(0, 2))
    wait_until(page, f"player.runs[0].motion.count === 2 && player.t === {scene.stamp_ns[1] / 1e9}")
