"""The viewer shows what the graph publishes, and the graph does not wait for it."""

from typing import Any

import numpy as np
import pytest
from rclpy.publisher import Publisher
from rclpy.qos import QoSReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import GraspEvent, TaskPhase
from visualization_msgs.msg import Marker, MarkerArray

from sms_handover.errors import MessageError, Reason
from sms_handover.graph.topics import (
    DEPUTY_POSE,
    GRASP_EVENT,
    PLANNED_PATHS,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
    VIEWER,
    Rate,
    graph_topics,
    target_pose,
    tool_pose,
)
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.values import planned_paths, pose_values
from sms_handover.nodes.parts.marker import path_markers
from sms_handover.nodes.viewer import ViewerNode
from sms_handover.plan_report import PlannedPaths
from sms_handover.ros.codecs.planned_paths import read_planned_paths
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import profile_of
from sms_handover.scene.live import LiveScene, Seen

from ..core.scene_documents import plans, poses, times
from .bench import Bench
from .graph import ARMS, Graph, Messages
from .short_handover import END_S

pytestmark = pytest.mark.ros

QUIET: dict[str, object] = {"port": 0, "browser": False, "frame_rate": 50.0}
TYPES = MessageTypes()


@pytest.fixture
def graph(bench: Bench) -> Graph:
    return Graph(bench, {"viewer": QUIET})


def shown(viewer: ViewerNode) -> Any:
    """Return all that the viewer shows; None as long as there is nothing."""
    scene = viewer.find_scene()
    news = scene.updates(Seen(), 0.0) if isinstance(scene, LiveScene) else None
    return news and news[0]


def heard(graph: Graph, topic: str) -> dict[float, np.ndarray]:
    """Return the poses that were published, by their time in s."""
    kind = "geometry_msgs/msg/PoseStamped"
    messages = [(stamp_ns(data), TYPES.deserialize(data, kind)) for data in graph.heard[topic]]
    return {stamp / 1e9: np.array(pose_values(message)) for stamp, message in messages}


def speaker_on(graph: Graph, name: str) -> Publisher:
    """Return a publisher on a topic of the graph that is none of its own."""
    topic = next(topic for topic in graph_topics(ARMS) if topic.name == name)
    return graph.client.create_publisher(message_class(topic.type), name, profile_of(topic))


def test_it_shows_every_body_where_it_was_published_and_every_plan(bench: Bench) -> None:
    graph = Graph(bench, {"viewer": QUIET, "controller": {"law": "mpc"}})
    viewer = graph.bench.add(ViewerNode)
    assert viewer.find_scene() == "Waiting for /robot_description and /deputy/marker"
    graph.run()
    graph.bench.until(lambda: shown(viewer) and len(shown(viewer)["events"]) == 2, "both grasps")
    document = shown(viewer)
    viewer.server.close()
    bodies = document["bodies"]
    drawn = dict(zip(times(document).tolist(), poses(document, len(bodies)), strict=True))
    assert 0 < max(drawn) <= END_S
    topics = {"deputy": DEPUTY_POSE}
    for arm in ARMS:
        topics |= {f"{arm}_tool": tool_pose(arm), f"{arm}/target": target_pose(arm)}
    for body, topic in topics.items():
        published = heard(graph, topic)
        for time, rows in drawn.items():
            assert np.abs(rows[bodies.index(body)][:3] - published[time][:3]).max() < 1e-6, body
    assert document["deputy_size"] == [0.1, 0.34, 0.1]
    published_plans = [planned_paths(message) for message in Messages().of(graph, PLANNED_PATHS)]
    stamps, lines = plans(document, len(ARMS))
    assert stamps.tolist() == [paths.stamp_ns / 1e9 for paths in published_plans] and len(stamps) > 2
    expected = [[paths.tool_in_world[arm] for arm in ARMS] for paths in published_plans]
    assert np.abs(lines - expected).max() < 1e-6


def test_planned_paths_are_read_as_they_were_sent_or_rejected() -> None:
    lines = {"arm_a": np.eye(3), "arm_b": np.arange(6.0).reshape(2, 3)}
    markers = path_markers(PlannedPaths(1_500_000_001, lines))
    read = read_planned_paths(serialize_message(markers))
    assert read.stamp_ns == 1_500_000_001 and read.tool_in_world.keys() == lines.keys()
    assert all(np.array_equal(read.tool_in_world[arm], points) for arm, points in lines.items())
    markers.markers[1].points[0].y = float("nan")
    empty = MarkerArray(markers=[markers.markers[0], Marker(ns="arm_b")])
    for bad, reason in ((markers, Reason.NOT_FINITE), (empty, Reason.LENGTHS), (None, Reason.MALFORMED)):
        with pytest.raises(MessageError) as caught:
            read_planned_paths(serialize_message(bad) if bad else b"nonsense")
        assert caught.value.reason is reason


def test_a_playback_that_goes_back_is_followed(graph: Graph) -> None:
    """The viewer hears an instant of the run again after the end, as of a player that was told to seek."""
    viewer = graph.bench.add(ViewerNode)
    graph.run()
    graph.bench.until(lambda: shown(viewer) and len(shown(viewer)["events"]) == 2, "both grasps")
    targets = [target_pose(arm) for arm in ARMS]
    wanted = (SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE, *targets)
    publishers = {name: speaker_on(graph, name) for name in wanted}

    def again() -> list[float]:
        for name, publisher in publishers.items():
            publisher.publish(graph.heard[name][5])
        return times(shown(viewer)).tolist() if shown(viewer) else []

    then = stamp_ns(graph.heard[DEPUTY_POSE][5]) / 1e9
    graph.bench.until(lambda: again() == [then], "the instant")
    viewer.server.close()


def test_bad_messages_are_refused_and_end_no_viewer(graph: Graph) -> None:
    """So is a state that the plant sends again, as it does when nothing answers it."""
    viewer = graph.bench.add(ViewerNode)
    graph.run()
    graph.bench.until(lambda: shown(viewer) and len(shown(viewer)["events"]) == 2, "both grasps")
    before = shown(viewer)
    newest = graph.heard[DEPUTY_POSE][-1]
    bad = {
        DEPUTY_POSE: [newest, newest[:30]],
        SAMPLED_JOINT_STATES: [serialize_message(JointState(name=["knee"], position=[0.0]))],
        TASK_PHASE: [serialize_message(TaskPhase(state=77))],
        GRASP_EVENT: [serialize_message(GraspEvent(status=77))],
        PLANNED_PATHS: [serialize_message(MarkerArray())],
    }
    say = [(speaker_on(graph, name), data) for name, messages in bad.items() for data in messages]

    def refused() -> dict[str, int]:
        for publisher, data in say:  # again and again, as the viewer is no reliable reader
            publisher.publish(data)
        return viewer.message_filter.counts

    expected = {
        "deputy/pose: duplicate stamp",
        "deputy/pose: malformed",
        "mpc/planned_paths: wrong lengths",
        "sampled_joint_states: wrong names",
        "task/grasp_event: wrong names",
        "task/phase: wrong names",
    }
    graph.bench.until(lambda: refused().keys() >= expected, "the refusals")
    assert viewer.message_filter.counts.keys() == expected
    assert shown(viewer) == before
    viewer.server.close()


def test_who_comes_late_sees_the_robot_and_what_came_of_the_grasps(graph: Graph) -> None:
    graph.run()
    viewer = graph.bench.add(ViewerNode)
    graph.bench.until(lambda: isinstance(viewer.find_scene(), LiveScene), "robot and deputy")
    viewer.server.close()


def test_the_graph_does_not_wait_for_a_viewer_that_takes_nothing(graph: Graph) -> None:
    """A reliable reader holds its writer back once it is far enough behind; none of these may be reliable."""
    viewer = ViewerNode()  # never spun
    try:
        graph.run()
        often = (Rate.TICK, Rate.REFERENCE, Rate.SHOWN)
        each_period = [topic for topic in graph_topics(ARMS) if topic.rate in often]
        readers = [
            reader
            for topic in each_period
            for reader in graph.client.get_subscriptions_info_by_topic(f"/{topic.name}")
            if reader.node_name == VIEWER
        ]
        assert len(readers) == 5  # state, base, deputy, phase, plans; it never learned of the arms
        for reader in readers:
            assert reader.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT
    finally:
        viewer.server.close()
        viewer.destroy_node()
