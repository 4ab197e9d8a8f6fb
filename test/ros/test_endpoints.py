"""Endpoints count what goes out, know who is missing, and wait for readers that are behind."""

from functools import partial
from typing import Any

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from std_msgs.msg import String

from sms_handover.errors import GraphError
from sms_handover.graph.topics import CONTROLLER, IK, NODES, PLANT, RECORDER, TRAJECTORY, Rate, Topic
from sms_handover.ros.node.endpoints import CountedPublisher, Endpoints
from sms_handover.ros.qos import LATCHED

from .bench import Bench

TEXT = "std_msgs/msg/String"
FROM_PLANT = Topic("from_plant", TEXT, (PLANT,), (TRAJECTORY, CONTROLLER), Rate.TICK)
TO_PLANT = Topic("to_plant", TEXT, (TRAJECTORY, IK, CONTROLLER), (PLANT,), Rate.CHANGE)
COMMAND = Topic("command", TEXT, (CONTROLLER,), (PLANT,), Rate.TICK)
TOPICS = (FROM_PLANT, TO_PLANT)


# A publisher alone


class FakePublisher:
    """Refuses the first messages as a full queue does."""

    topic_name = "/fake"

    def __init__(self, refusals: int) -> None:
        """Refuse so many times."""
        self.refusals = refusals
        self.tries = 0
        self.sent: list[object] = []

    def get_subscription_count(self) -> int:
        """Return a made-up number."""
        return 7

    def publish(self, message: object) -> None:
        """Refuse or keep a message."""
        self.tries += 1
        if self.tries <= self.refusals:
            raise rclpy_implementation.RCLError("cannot publish data")
        self.sent.append(message)


class Time:
    """Time that passes only in sleep."""

    def __init__(self) -> None:
        """Start at any time."""
        self.now = 5.0

    def monotonic(self) -> float:
        """Return the time in s."""
        return self.now

    def sleep(self, duration: float) -> None:
        """Let time pass."""
        assert duration > 0.0
        self.now += duration


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Time:
    time = Time()
    monkeypatch.setattr("sms_handover.ros.node.endpoints.monotonic", time.monotonic)
    monkeypatch.setattr("sms_handover.ros.node.endpoints.sleep", time.sleep)
    return time


def counted(fake: FakePublisher) -> CountedPublisher:
    publisher: Any = fake
    return CountedPublisher(publisher)


@pytest.mark.parametrize("refusals", [0, 1, 5, 200])
def test_a_full_queue_holds_the_writer_back(time: Time, refusals: int) -> None:
    fake = FakePublisher(refusals)
    publisher = counted(fake)
    publisher.publish("one")
    publisher.publish("two")
    assert fake.sent == ["one", "two"]  # each once, in order
    assert publisher.count == 2
    assert fake.tries == refusals + 2


def test_a_reader_that_takes_nothing_is_given_up(time: Time) -> None:
    fake = FakePublisher(refusals=10**9)
    publisher = counted(fake)
    with pytest.raises(GraphError, match="a reader of /fake is stuck: cannot publish data"):
        publisher.publish("one")
    assert publisher.count == 0
    assert 10.0 < time.now - 5.0 < 60.0


def test_patience_restarts_run_with_every_message(time: Time) -> None:
    fake = FakePublisher(refusals=20_000)
    publisher = counted(fake)
    publisher.publish("one")
    fake.tries = 0
    publisher.publish("two")
    assert publisher.count == 2


def test_other_errors_are_not_swallowed(time: Time) -> None:
    class Broken(FakePublisher):
        def publish(self, message: object) -> None:
            raise TypeError("expected a message")

    publisher = counted(Broken(0))
    with pytest.raises(TypeError, match="expected a message"):
        publisher.publish("one")
    assert publisher.count == 0


def test_wrapper_tells_what_the_publisher_tells() -> None:
    publisher = counted(FakePublisher(0))
    assert (publisher.topic_name, publisher.subscription_count) == ("/fake", 7)


# Endpoints of a graph


def listen(node: Node, *topics: Topic) -> list[str]:
    """Subscribe to topics as a node of the graph does, and return where its messages go."""
    heard: list[str] = []
    endpoints = Endpoints(node, TOPICS, NODES)
    for topic in topics:
        endpoints.subscribe(topic.name, lambda message: heard.append(message.data))
    return heard


@pytest.mark.ros
def test_counts_are_by_full_name(bench: Bench) -> None:
    bench.start()
    node = bench.add(lambda: Node(PLANT, namespace="/left"))
    endpoints = Endpoints(node, TOPICS, (PLANT,))
    publisher = endpoints.publisher(FROM_PLANT.name)
    assert endpoints.counts == {"/left/from_plant": 0}
    for _ in range(3):
        publisher.publish(String())
    assert endpoints.counts == {"/left/from_plant": 3}
    assert endpoints.topics == TOPICS


@pytest.mark.ros
def test_messages_and_bytes_arrive_alike(bench: Bench) -> None:
    bench.start()
    plant, controller = bench.plain(PLANT), bench.plain(CONTROLLER)
    publisher = Endpoints(plant, TOPICS, (PLANT, CONTROLLER)).publisher(FROM_PLANT.name)
    raw: list[bytes] = []
    Endpoints(controller, TOPICS, (PLANT, CONTROLLER)).subscribe(FROM_PLANT.name, raw.append, raw=True)
    bench.until(lambda: publisher.subscription_count == 1, "the match")
    publisher.publish(String(data="hello"))
    bench.until(lambda: len(raw) == 1, "the message")
    publisher.publish(raw[0])
    bench.until(lambda: len(raw) == 2, "the bytes")
    assert raw[0] == raw[1]
    assert b"hello\0" in raw[0]
    assert publisher.count == 2


@pytest.mark.ros
def test_alone_nothing_is_missing(bench: Bench) -> None:
    bench.start()
    endpoints = Endpoints(bench.plain(PLANT), TOPICS, (PLANT,))
    endpoints.publisher(FROM_PLANT.name)
    endpoints.subscribe(TO_PLANT.name, lambda message: None)
    assert endpoints.unmatched == []


@pytest.mark.ros
def test_who_is_missing_is_said_in_words(bench: Bench) -> None:
    bench.start()
    plant = Endpoints(bench.plain(PLANT), TOPICS, NODES)
    plant.publisher(FROM_PLANT.name)
    plant.subscribe(TO_PLANT.name, lambda message: None)
    assert plant.unmatched == ["0 of 3 subscriptions of from_plant", "0 of 3 publishers of to_plant"]
    listen(bench.plain(CONTROLLER), FROM_PLANT)
    bench.until(lambda: plant.unmatched[0].startswith("1 of 3 subscriptions"), "the first match")
    others = [bench.plain(name) for name in (TRAJECTORY, IK, RECORDER)]
    for node in (others[0], others[2]):
        listen(node, FROM_PLANT)
    bench.until(lambda: plant.unmatched == ["0 of 3 publishers of to_plant"], "all subscriptions")
    for node in (bench.plain(CONTROLLER), *others[:2]):
        Endpoints(node, TOPICS, NODES).publisher(TO_PLANT.name)
    bench.until(lambda: plant.unmatched == [], "all publishers")


@pytest.mark.ros
def test_only_peers_are_waited_for(bench: Bench) -> None:
    bench.start()
    endpoints = Endpoints(bench.plain(PLANT), TOPICS, (PLANT, CONTROLLER))
    endpoints.publisher(FROM_PLANT.name)
    endpoints.subscribe(TO_PLANT.name, lambda message: None)
    assert endpoints.unmatched == ["0 of 1 subscriptions of from_plant", "0 of 1 publishers of to_plant"]


@pytest.mark.ros
def test_a_stranger_does_not_stand_in_for_a_peer(bench: Bench) -> None:
    """The launcher's display, or a user's own tool, listens too; the run must still wait for the peers."""
    bench.start()
    peers = (PLANT, TRAJECTORY, RECORDER)
    plant = Endpoints(bench.plain(PLANT), TOPICS, peers)
    publisher = plant.publisher(FROM_PLANT.name)
    plant.subscribe(TO_PLANT.name, lambda message: None)
    for number in range(2):
        listen(bench.plain(f"stranger_{number}"), FROM_PLANT)
        Endpoints(bench.plain(f"speaker_{number}"), TOPICS, NODES).publisher(TO_PLANT.name)
    missing = ["0 of 2 subscriptions of from_plant", "0 of 1 publishers of to_plant"]
    bench.until(lambda: publisher.subscription_count == 2, "the strangers")
    assert plant.unmatched == missing
    for name in (TRAJECTORY, RECORDER):
        node = bench.plain(name)
        listen(node, FROM_PLANT)
        Endpoints(node, TOPICS, NODES).publisher(TO_PLANT.name)
    bench.until(lambda: plant.unmatched == [], "the peers")


@pytest.mark.ros
def test_a_peer_that_is_there_may_not_have_matched_yet(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only how many have matched is known, so the stranger is taken to have done so first."""
    bench.start()
    plant = Endpoints(bench.plain(PLANT), TOPICS, (PLANT, CONTROLLER))
    publisher = plant.publisher(FROM_PLANT.name)
    for name in (CONTROLLER, "stranger"):
        listen(bench.plain(name), FROM_PLANT)
    bench.until(lambda: publisher.subscription_count == 2 and plant.unmatched == [], "both")
    missing = ["0 of 1 subscriptions of from_plant"]
    for matched, expected in ((0, missing), (1, missing), (2, [])):
        count = property(partial(lambda number, self: number, matched))
        monkeypatch.setattr(CountedPublisher, "subscription_count", count)
        assert plant.unmatched == expected


@pytest.mark.ros
def test_a_stranger_that_cannot_match_does_not_hold_the_run_back(bench: Bench) -> None:
    """It asks for latched messages where none are."""
    bench.start()
    plant = Endpoints(bench.plain(PLANT), TOPICS, (PLANT, CONTROLLER))
    publisher = plant.publisher(FROM_PLANT.name)
    bench.plain("stranger").create_subscription(String, FROM_PLANT.name, lambda message: None, LATCHED)
    listen(bench.plain(CONTROLLER), FROM_PLANT)
    bench.until(lambda: plant.unmatched == [], "the peer")
    assert publisher.subscription_count == 1


# A node of somebody else's among the peers

_WITH_EXTERNAL = ((FROM_PLANT, TO_PLANT, COMMAND), (PLANT, TRAJECTORY, CONTROLLER), (CONTROLLER,))


@pytest.mark.ros
def test_of_an_external_node_only_the_endpoints_of_the_tick_are_needed(bench: Bench) -> None:
    bench.start()
    plant = Endpoints(bench.plain(PLANT), *_WITH_EXTERNAL)
    plant.publisher(FROM_PLANT.name)
    for topic in (TO_PLANT, COMMAND):
        plant.subscribe(topic.name, lambda message: None)
    missing = ["subscriptions of from_plant", "publishers of to_plant", "publishers of command"]
    assert plant.unmatched == [f"0 of {n} {what}" for n, what in zip((2, 1, 1), missing, strict=True)]
    trajectory = bench.plain(TRAJECTORY)
    listen(trajectory, FROM_PLANT)
    Endpoints(trajectory, TOPICS, NODES).publisher(TO_PLANT.name)
    still = [f"1 of 2 {missing[0]}", f"0 of 1 {missing[2]}"]
    bench.until(lambda: plant.unmatched == still, "the node of ours; the external one has no to_plant")
    external = bench.plain(CONTROLLER)
    listen(external, FROM_PLANT)
    external.create_publisher(String, COMMAND.name, 10)
    bench.until(lambda: plant.unmatched == [], "the external node")


@pytest.mark.ros
def test_what_else_an_external_node_has_is_waited_for_too(bench: Bench) -> None:
    """That it offers ``to_plant`` makes it one whose word there counts."""
    bench.start()
    plant = Endpoints(bench.plain(PLANT), *_WITH_EXTERNAL)
    assert plant.not_publishing(TO_PLANT.name) == {CONTROLLER}
    bench.plain(CONTROLLER).create_publisher(String, TO_PLANT.name, 10)
    bench.until(lambda: plant.not_publishing(TO_PLANT.name) == frozenset(), "its publisher")


@pytest.mark.ros
def test_nodes_that_do_not_hear_the_external_one_wait_for_it_too(bench: Bench) -> None:
    """Its subscriptions are there once it is, so none of them misses the first message."""
    bench.start()
    trajectory = Endpoints(bench.plain(TRAJECTORY), *_WITH_EXTERNAL)
    assert trajectory.unmatched == ["the external node 'controller', which publishes command"]
    bench.plain(CONTROLLER).create_publisher(String, COMMAND.name, 10)
    bench.until(lambda: trajectory.unmatched == [], "the external node")
    itself = Endpoints(bench.plain(CONTROLLER), *_WITH_EXTERNAL)
    assert itself.unmatched == []
