"""Any topics recorded: those that are there, those that come later, in the order in which they were sent."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import Int32, String

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.time_order import messages_by_time
from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import TOPIC_RECORDER
from sms_handover.nodes.topic_recorder import TopicRecorderNode
from sms_handover.ros.process.main import EXIT_FAILED, EXIT_OK
from sms_handover.ros.qos import LATCHED, LOSSLESS

from .bench import Bench
from .script import Script, Stop

pytestmark = pytest.mark.ros

SENSOR = QoSProfile(depth=5, reliability=QoSReliabilityPolicy.BEST_EFFORT)


def record(bench: Bench, script: Script) -> int:
    """Record while a script runs; return the exit code."""
    node = bench.add(TopicRecorderNode)
    stop: Any = Stop(script)
    return node.run(bench.executor, stop)


def test_topics_keep_their_order_among_each_other_and_their_quality(bench: Bench, tmp_path: Path) -> None:
    bench.start({TOPIC_RECORDER: {"folder": str(tmp_path / "bag")}})
    user = bench.plain("user")
    numbers = user.create_publisher(Int32, "numbers", LOSSLESS)
    words = user.create_publisher(String, "words", SENSOR)
    latched = user.create_publisher(String, "before", LATCHED)
    latched.publish(String(data="before the recorder"))

    def script() -> Script:
        while not (numbers.get_subscription_count() and words.get_subscription_count()):
            yield
        for number in range(100):
            numbers.publish(Int32(data=number))
            words.publish(String(data=str(number)))
            if number % 10 == 0:
                yield
        later = user.create_publisher(Int32, "later", LOSSLESS)
        while not later.get_subscription_count():
            yield
        later.publish(Int32(data=1))

    assert record(bench, script()) == EXIT_OK
    topics = [m.topic for m in messages_by_time(tmp_path / "bag") if m.topic in ("/numbers", "/words")]
    assert topics[:6] == ["/numbers", "/words"] * 3
    assert topics == ["/numbers", "/words"] * 100
    info = read_info(tmp_path / "bag")
    counts = {name: topic.message_count for name, topic in info.topics.items()}
    assert (counts["/before"], counts["/later"]) == (1, 1)
    for name, reliability, durability in (
        ("/numbers", "reliable", "volatile"),
        ("/words", "best_effort", "volatile"),
        ("/before", "reliable", "transient_local"),
    ):
        (qos,) = yaml.safe_load(info.topics[name].qos)
        assert (qos["reliability"], qos["durability"]) == (reliability, durability)
    sent = [m.publish_time_ns for m in read_messages(tmp_path / "bag", ("/numbers",))]
    assert sent == sorted(sent) and sent[0] > 10**18  # wall time


def test_only_chosen_topics_are_recorded(bench: Bench, tmp_path: Path) -> None:
    parameters = {"folder": str(tmp_path / "bag"), "regex": "^/wanted", "exclude_topics": ("/wanted/not",)}
    bench.start({TOPIC_RECORDER: parameters})
    user = bench.plain("user")
    publishers = {
        name: user.create_publisher(Int32, name, LOSSLESS) for name in ("wanted/one", "wanted/not", "other")
    }

    def script() -> Script:
        while not publishers["wanted/one"].get_subscription_count():
            yield
        for publisher in publishers.values():
            publisher.publish(Int32())
        yield

    assert record(bench, script()) == EXIT_OK
    assert [m.topic for m in read_messages(tmp_path / "bag")] == ["/wanted/one"]
    assert set(read_info(tmp_path / "bag").topics) == {"/wanted/one"}


def test_nothing_recorded_is_a_failure(bench: Bench, tmp_path: Path) -> None:
    bench.start({TOPIC_RECORDER: {"folder": str(tmp_path / "bag"), "topics": ("/nothing",), "duration": 0.3}})

    def forever() -> Script:
        while True:
            yield

    assert record(bench, forever()) == EXIT_FAILED
    assert read_info(tmp_path / "bag").message_count == 0


def test_a_folder_that_is_there_is_refused(bench: Bench, tmp_path: Path) -> None:
    bench.start({TOPIC_RECORDER: {"folder": str(tmp_path)}})
    with pytest.raises(ConfigurationError, match="exists already"):
        TopicRecorderNode()
