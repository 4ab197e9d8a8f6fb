"""Nothing is lost on the loop's topics, and what is latched reaches late comers."""

from collections.abc import Callable
from typing import Any

import pytest
from rclpy.qos import QoSCompatibility, QoSProfile, QoSReliabilityPolicy, qos_check_compatible
from std_msgs.msg import String

from sms_handover.bag.qos import Durability, History, Reliability
from sms_handover.errors import GraphError
from sms_handover.graph.topics import TF, Rate, graph_topics
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import LATCHED, LOSSLESS, profile_of, stored

from .bench import Bench

TOPICS = graph_topics(("arm_a", "arm_b"))


def notebook() -> tuple[list[str], Callable[[Any], None]]:
    """Return a list and a callback that puts the text of every message into it."""
    heard: list[str] = []
    return heard, lambda message: heard.append(message.data)


def test_every_topic_is_reliable_and_the_loop_loses_nothing() -> None:
    for topic in TOPICS:
        profile = stored(profile_of(topic))
        assert profile.reliability is Reliability.RELIABLE
        if topic.name == TF:
            assert profile.history is History.KEEP_LAST  # others read it too, and may hang
        elif topic.rate in (Rate.TICK, Rate.REFERENCE, Rate.CLOCK):
            assert profile.history is History.KEEP_ALL
            assert profile.durability is Durability.VOLATILE
        latched = topic.rate is Rate.CHANGE
        assert (profile.durability is Durability.TRANSIENT_LOCAL) is latched is topic.latched


def test_every_type_of_the_graph_is_installed() -> None:
    for topic in TOPICS:
        assert message_class(topic.type).__name__ == topic.type.rsplit("/", 1)[1]


@pytest.mark.parametrize("name", ["no_such_package/msg/String", "std_msgs/msg/NoSuchType"])
def test_a_type_that_is_not_installed_is_named(name: str) -> None:
    with pytest.raises(GraphError, match=f"{name} is not installed"):
        message_class(name)


@pytest.mark.parametrize("profile", [LOSSLESS, LATCHED])
def test_a_display_can_listen(profile: QoSProfile) -> None:
    """Most tools ask for less than what is offered: one volatile message, reliable or not."""
    for reliability in (QoSReliabilityPolicy.RELIABLE, QoSReliabilityPolicy.BEST_EFFORT):
        tool = QoSProfile(
            depth=1,
            reliability=reliability,
            durability=LOSSLESS.durability,
            liveliness=LOSSLESS.liveliness,
            deadline=LOSSLESS.deadline,
            liveliness_lease_duration=LOSSLESS.liveliness_lease_duration,
        )
        compatibility, reason = qos_check_compatible(profile, tool)
        assert compatibility == QoSCompatibility.OK, reason


def test_stored_profile_is_what_rosbag2_writes() -> None:
    assert stored(LATCHED).to_rosbag2() == {
        "history": "keep_last",
        "depth": 100,
        "reliability": "reliable",
        "durability": "transient_local",
        "deadline": {"sec": 9223372036, "nsec": 854775807},
        "lifespan": {"sec": 9223372036, "nsec": 854775807},
        "liveliness": "automatic",
        "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
        "avoid_ros_namespace_conventions": False,
    }
    assert stored(LOSSLESS).to_rosbag2()["history"] == "keep_all"


@pytest.mark.ros
def test_late_comers_get_what_is_latched_in_order(bench: Bench) -> None:
    bench.start()
    speaker, listener = bench.plain("speaker"), bench.plain("listener")
    publisher = speaker.create_publisher(String, "latched", LATCHED)
    for number in range(100):
        publisher.publish(String(data=str(number)))
    heard, note = notebook()
    listener.create_subscription(String, "latched", note, LATCHED)
    bench.until(lambda: len(heard) == 100, "what was published before")
    assert heard == [str(number) for number in range(100)]


@pytest.mark.ros
def test_a_reader_far_behind_loses_nothing(bench: Bench) -> None:
    """Far more messages than a queue of ROS's default depth holds, before the reader takes the first."""
    count = 2000
    bench.start()
    speaker, listener = bench.plain("speaker"), bench.plain("listener")
    heard, note = notebook()
    listener.create_subscription(String, "lossless", note, LOSSLESS)
    publisher = speaker.create_publisher(String, "lossless", LOSSLESS)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the match")
    for number in range(count):
        publisher.publish(String(data=str(number)))
    bench.until(lambda: len(heard) == count, "every message")
    assert heard == [str(number) for number in range(count)]
