"""A live scene tells everybody who looks what the whole one would, each instant once."""

import json
from collections.abc import Iterator
from dataclasses import replace
from threading import Thread
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.plan_report import PlannedPaths
from sms_handover.run_data import RunData
from sms_handover.scene.document import scene_document
from sms_handover.scene.live import LiveScene, Seen
from sms_handover.scene.page import STREAM
from sms_handover.scene.scene import Scene, make_scene
from sms_handover.scene.server import SceneServer
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.simulate import simulate

from .conftest import MakeScenario
from .scene_documents import frames, plans, play, poses, times

PATIENCE_S = 60.0  # s of wall time after which a wait has failed


@pytest.fixture
def scenario(make_scenario: MakeScenario) -> Scenario:
    return make_scenario(common={"duration": 0.6})


@pytest.fixture
def run(scenario: Scenario) -> RunData:
    """A run that has plans, as one under a predictive law; the horizon of the last one is shorter."""
    simulated = simulate(scenario)
    lines = {arm: poses[:4, :3] for arm, poses in simulated.tool_pose.items()}
    shorter = {arm: points[1:] for arm, points in lines.items()}
    stamps = ((0, lines), (160_000_000, lines), (200_000_000, shorter))
    return replace(simulated, planned_paths=tuple(PlannedPaths(*each) for each in stamps))


@pytest.fixture
def scene(scenario: Scenario, run: RunData) -> Scene:
    return make_scene(run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


@pytest.fixture
def live(scenario: Scenario) -> LiveScene:
    return LiveScene(scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


def test_in_the_end_it_is_the_scene_of_the_run(live: LiveScene, run: RunData, scene: Scene) -> None:
    play(live, run, scene)
    news = live.updates(Seen(), 0.0)
    assert news is not None
    expected = scene_document("live", replace(scene, grasp_events=()))
    assert json.loads(json.dumps(news[0])) == json.loads(json.dumps(expected))


def test_what_is_new_is_told_once(live: LiveScene, run: RunData, scene: Scene) -> None:
    play(live, run, scene, slice(0, 5))
    first = live.updates(Seen(), 0.0)
    assert first is not None and "shapes" in first[0]
    assert live.updates(first[1], 0.0) is None
    play(live, run, scene, slice(5, 8))
    second = live.updates(first[1], 0.0)
    assert second is not None and "shapes" not in second[0]
    told = np.concatenate([times(first[0]), times(second[0])])
    assert np.array_equal(told, scene.stamp_ns[:8] / 1e9)


def test_plans_are_told_with_the_instants_that_follow_them(
    live: LiveScene, run: RunData, scene: Scene
) -> None:
    """Each once, with the points that its horizon has; where no law plans, nothing is told of plans."""
    arms, planned = len(scene.arms), run.planned_paths
    play(live, replace(run, planned_paths=()), scene, slice(0, 1))
    bare = live.updates(Seen(), 0.0)
    assert bare is not None and "planned" not in bare[0]
    live.add_paths(planned[0])
    assert live.updates(bare[1], 0.0)[0]["planned"] != {}  # type: ignore[index]
    play(live, run, scene, slice(1, 5))
    first = live.updates(bare[1], 0.0)
    live.add_paths(replace(planned[1], stamp_ns=planned[1].stamp_ns + 1))  # too soon
    play(live, run, scene, slice(5, 6))
    assert first is not None
    second = live.updates(first[1], 0.0)
    assert second is not None and live.updates(second[1], 0.0) is None
    for (told, _), expected in ((first, planned[:2]), (second, planned[2:])):
        stamps, lines = plans(told, arms)
        assert stamps.tolist() == [paths.stamp_ns / 1e9 for paths in expected]
        points = [[paths.tool_in_world[arm] for arm in scene.arms] for paths in expected]
        np.testing.assert_allclose(lines, points, rtol=0.0, atol=1e-6)  # m; single precision


def test_a_plan_of_an_earlier_instant_begins_another_run(live: LiveScene, run: RunData, scene: Scene) -> None:
    """It may come before the phase and the frame of that instant."""
    play(live, run, scene)
    live.add_paths(run.planned_paths[0])
    play(live, replace(run, planned_paths=()), scene, slice(0, 1))
    again = live.updates(Seen(), 0.0)
    assert again is not None and times(again[0]).tolist() == plans(again[0], 2)[0].tolist() == [0.0]


def test_poses_are_those_of_the_run(live: LiveScene, run: RunData, scene: Scene) -> None:
    play(live, run, scene)
    news = live.updates(Seen(), 0.0)
    assert news is not None
    told = poses(news[0], len(scene.links) + 1 + len(scene.arms))
    targets = [scene.target_in_world[arm][:, None] for arm in scene.arms]
    expected = np.concatenate([scene.link_in_world, scene.deputy_in_world[:, None], *targets], axis=1)
    assert np.abs(told - expected).max() < 1e-6  # m; single precision


def test_a_frame_that_goes_back_begins_another_run(live: LiveScene, run: RunData, scene: Scene) -> None:
    """Whether the phase or the frame comes first depends on the middleware."""
    for frame in (*frames(run, scene), frames(run, scene)[0]):
        live.add(frame)
    news = live.updates(Seen(), 0.0)
    assert news is not None and times(news[0]).tolist() == [0.0]


def test_instants_between_frames_are_left_out(scenario: Scenario, run: RunData, scene: Scene) -> None:
    slow = LiveScene(scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size, frame_rate=5.0)
    play(slow, run, scene)
    news = slow.updates(Seen(), 0.0)
    assert news is not None
    assert times(news[0]).tolist() == [0.0, 0.2, 0.4, 0.6]


def test_a_stamp_that_goes_back_begins_another_run(live: LiveScene, run: RunData, scene: Scene) -> None:
    play(live, run, scene)
    before = live.updates(Seen(), 0.0)
    assert before is not None
    live.add_event(scene.grasp_events[0])
    play(live, run, scene, slice(0, 2))
    again = live.updates(before[1], 0.0)
    assert again is not None and "shapes" in again[0]
    assert times(again[0]).tolist() == (scene.stamp_ns[:2] / 1e9).tolist()
    assert again[0]["events"] == []
    assert [phase["name"] for phase in again[0]["phases"]] == ["approach"]  # type: ignore[attr-defined]


def test_who_waits_is_woken(live: LiveScene, run: RunData, scene: Scene) -> None:
    told: list[Any] = []
    waiting = Thread(target=lambda: told.append(live.updates(Seen(), PATIENCE_S)))
    waiting.start()
    live.add(frames(run, scene)[0])
    waiting.join(PATIENCE_S)
    assert told and told[0] is not None and told[0][1].frames == 1


def test_a_long_run_keeps_its_newest_frames(
    live: LiveScene, run: RunData, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sms_handover.scene.live._MOST_FRAMES", 8)
    play(live, run, scene, slice(0, 8))
    seen = live.updates(Seen(), 0.0)
    assert seen is not None
    play(live, run, scene, slice(8, 9))
    news = live.updates(seen[1], 0.0)
    assert news is not None and "shapes" in news[0]
    assert times(news[0]).tolist() == (scene.stamp_ns[4:9] / 1e9).tolist()
    assert plans(news[0], 2)[0].tolist() == [0.16, 0.2]


@pytest.mark.parametrize("frame_rate", [0.0, -5.0, float("nan")])
def test_a_rate_that_is_not_positive_is_refused(scenario: Scenario, frame_rate: float) -> None:
    with pytest.raises(ConfigurationError, match=r"frame rate is .* 1/s, it must be > 0"):
        LiveScene(scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size, frame_rate)


# Served


@pytest.fixture
def server(live: LiveScene) -> Iterator[SceneServer]:
    serving = SceneServer(lambda: live, 0, "a live run")
    yield serving
    serving.close()


def events(stream: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and data of server-sent events."""
    while True:
        name, data, _ = (stream.readline().decode().rstrip("\n") for _ in range(3))
        yield name.removeprefix("event: "), json.loads(data.removeprefix("data: "))


def test_a_stream_begins_with_the_scene_and_goes_on_with_frames(
    server: SceneServer, live: LiveScene, run: RunData, scene: Scene
) -> None:
    play(live, run, scene, slice(0, 3))
    with urlopen(server.address + STREAM, timeout=PATIENCE_S) as stream:
        assert stream.headers["Content-Type"] == "text/event-stream"
        coming = events(stream)
        name, document = next(coming)
        assert name == "scene" and len(times(document)) == 3
        live.add(frames(run, scene)[3])
        name, document = next(event for event in coming if event[0] != "waiting")
        assert name == "frames" and times(document).tolist() == [scene.stamp_ns[3] / 1e9]


def test_the_page_is_there_and_nothing_else(server: SceneServer) -> None:
    with urlopen(server.address, timeout=PATIENCE_S) as answer:
        assert b"<title>a live run</title>" in answer.read()
    with pytest.raises(HTTPError, match="404"):
        urlopen(server.address + "etc/passwd", timeout=PATIENCE_S)


@pytest.mark.parametrize("path", ["", STREAM])
@pytest.mark.parametrize("name", ["a.stranger.example", "127.0.0.1.example", ""])
def test_a_site_whose_name_leads_here_gets_nothing(server: SceneServer, path: str, name: str) -> None:
    """DNS rebinding: a browser sends the name it asked for, which no page can change."""
    port = server.address.rstrip("/").rpartition(":")[2]
    asked = Request(server.address + path, headers={"Host": f"{name}:{port}"})
    with pytest.raises(HTTPError, match="403"):
        urlopen(asked, timeout=PATIENCE_S)


def test_a_forwarded_port_may_have_another_number(server: SceneServer) -> None:
    with urlopen(Request(server.address, headers={"Host": "localhost:9000"}), timeout=PATIENCE_S) as answer:
        assert answer.status == 200


def test_it_listens_to_this_machine_alone(server: SceneServer) -> None:
    assert server.address.startswith("http://127.0.0.1:")


def test_as_long_as_there_is_no_scene_it_says_what_is_missing() -> None:
    server = SceneServer(lambda: "waiting for the robot", 0, "")
    try:
        with urlopen(server.address + STREAM, timeout=PATIENCE_S) as stream:
            assert next(events(stream)) == ("waiting", {"text": "waiting for the robot"})
    finally:
        server.close()


def test_a_port_that_is_taken_is_named(server: SceneServer, live: LiveScene) -> None:
    port = int(server.address.rstrip("/").rpartition(":")[2])
    with pytest.raises(ConfigurationError, match=f"port {port} cannot be served: .* choose another"):
        SceneServer(lambda: live, port, "")
