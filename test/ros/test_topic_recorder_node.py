"""Any topics recorded: those that are there, those that come later, in the order in which they were sent."""

from pathlib import Path
from threading import Event, Thread
from time import time_ns
from typing import Any

import pytest
import yaml
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import Empty, Int32, Int64, String

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.time_order import messages_by_time
from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.graph.topics import TOPIC_RECORDER
from sms_handover.messages.message_types import MessageTypes
from sms_handover.nodes import topic_recorder
from sms_handover.nodes.topic_recorder import TopicRecorderNode
from sms_handover.ros.message_types import message_class
from sms_handover.ros.process.main import EXIT_FAILED, EXIT_LOSS, EXIT_OK
from sms_handover.ros.qos import LATCHED, LOSSLESS

from .bench import Bench
from .script import Script, Stop

pytestmark = pytest.mark.ros

SCHEMA = MessageTypes.schema
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


def test_one_bad_topic_never_takes_down_the_rest(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Two types on a topic, a type that is not installed, no definition to be read, a later weaker QoS."""

    def installed(name: str) -> Any:
        if name == "std_msgs/msg/Empty":
            raise GraphError(f"message type {name} is not installed")
        return message_class(name)

    def schema(self: MessageTypes, name: str) -> Any:
        if name == "std_msgs/msg/Int64":
            raise BagError("wstring is not read")
        return SCHEMA(self, name)

    monkeypatch.setattr(topic_recorder, "message_class", installed)
    monkeypatch.setattr(MessageTypes, "schema", schema)
    bench.start({TOPIC_RECORDER: {"folder": str(tmp_path / "bag"), "exclude_regex": "rosout|events"}})
    user, other = bench.stranger("user"), bench.stranger("other")
    kinds = {"both": Int32, "empty": Empty, "bytes": Int64, "weak": Int32}
    publishers = {name: user.create_publisher(kind, name, LOSSLESS) for name, kind in kinds.items()}

    def script() -> Script:
        while not all(publishers[name].get_subscription_count() for name in ("both", "bytes", "weak")):
            yield
        other.create_publisher(String, "both", LOSSLESS)
        other.create_publisher(Int32, "weak", SENSOR)
        while capfd.readouterr().err.count("not recorded: /weak") == 0:
            yield
        for name in ("both", "bytes", "weak"):
            publishers[name].publish(kinds[name](data=1))

    assert record(bench, script()) == EXIT_LOSS
    assert {m.topic: m.type for m in read_messages(tmp_path / "bag")} == {
        "/both": "std_msgs/msg/Int32",
        "/bytes": "std_msgs/msg/Int64",
        "/weak": "std_msgs/msg/Int32",
    }


def test_what_is_sent_after_the_end_is_not_recorded(bench: Bench, tmp_path: Path) -> None:
    """A graph that goes on does not keep the recorder, and gets nothing more into the bag."""
    bench.start({TOPIC_RECORDER: {"folder": str(tmp_path / "bag"), "topics": ("/live",), "duration": 1.0}})
    user = bench.stranger("user")
    live = user.create_publisher(Int32, "live", LOSSLESS)
    ended = Event()
    sent: list[int] = []

    def publish() -> None:
        while not ended.wait(0.001):
            sent.append(time_ns())
            live.publish(Int32(data=len(sent)))

    thread = Thread(target=publish)
    thread.start()
    node = bench.add(TopicRecorderNode)
    try:
        stop: Any = Stop()
        assert node.run(bench.executor, stop) == EXIT_OK
    finally:
        ended.set()
        thread.join()
    end_ns = node._end_ns
    assert end_ns is not None and end_ns < sent[-1]
    times = [m.publish_time_ns for m in read_messages(tmp_path / "bag")]
    assert times and times[-1] <= end_ns
