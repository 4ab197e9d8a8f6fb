"""What is refused at the door of a node is counted, told once a second, and changes no bit of the run."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import GraspCommand, RunState
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

from sms_handover.errors import MessageError, Reason
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    DEPUTY_POSE,
    DIAGNOSTICS,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    PLANT,
    RUN_EVENTS,
    RUN_RECORDED,
    RUN_STATE,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
    TRAJECTORY,
)
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.node.message_filter import MessageFilter
from sms_handover.ros.qos import LOSSLESS
from sms_handover.ros.transport.publisher_identity import PublisherIdentity
from sms_handover.simulation.parameters import DIRECT, EXECUTOR

from .bench import Bench
from .graph import Graph, Messages

BAD = MessageError(Reason.NOT_FINITE, "the effort is not finite")

# The counts alone


class Log:
    """MessageFilter with a wall clock that stands still, and what they tell."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Begin at any time."""
        self.now = 100.0
        self.lines: list[str] = []
        self.firsts: list[str] = []
        monkeypatch.setattr("sms_handover.ros.node.message_filter.monotonic", lambda: self.now)
        self.message_filter = MessageFilter(self.lines.append, lambda topic, error: self.firsts.append(topic))


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> Log:
    return Log(monkeypatch)


def test_a_flood_is_one_line_a_second(log: Log) -> None:
    for _ in range(3):
        for _ in range(1000):
            log.message_filter.reject("joint_command", BAD)
        log.now += 1.0
    log.message_filter.report()
    assert log.firsts == ["joint_command"]
    assert log.message_filter.counts == {"joint_command: not finite": 3000}
    assert len(log.lines) == 4
    assert log.lines[0] == "joint_command: rejected, not finite: the effort is not finite"
    assert log.lines[1].endswith("(998 more since the last line)")
    assert sum("more" in line for line in log.lines) == 3


def test_each_topic_and_reason_is_counted_by_itself(log: Log) -> None:
    log.message_filter.reject("a", BAD)
    log.message_filter.reject("b", BAD)
    log.message_filter.reject("b", MessageError(Reason.OLD, "late"))
    assert log.firsts == ["a", "b", "b"]
    assert list(log.message_filter.counts.values()) == [1, 1, 1]


def test_nothing_refused_is_not_told(log: Log) -> None:
    log.message_filter.report()
    assert log.lines == [] and log.message_filter.counts == {}


def test_a_message_that_fails_a_check_is_not_handed_on(log: Log) -> None:
    taken: list[bytes] = []

    def checked(data: bytes) -> bytes:
        if data == b"bad":
            raise BAD
        return data

    deliver = log.message_filter.wrap("a", lambda data, sent_ns: taken.append(data), checked)
    for data in (b"one", b"bad", b"two"):
        deliver(data, 0, b"")
    assert taken == [b"one", b"two"]
    assert log.message_filter.counts == {"a: not finite": 1}


def test_other_errors_are_not_swallowed(log: Log) -> None:
    def fail(data: bytes, sent_ns: int) -> None:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError):
        log.message_filter.wrap("a", fail, bytes)(b"", 0, b"")


# Who a message is from


class FakeGraph:
    """A node that knows who publishes, by name and identifier."""

    def __init__(self, **publishers: int) -> None:
        """Let these nodes publish."""
        self.publishers = publishers

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        """Return who publishes, whatever the topic."""
        return [
            SimpleNamespace(node_name=name, node_namespace="/", endpoint_gid=[number] * 16)
            for name, number in self.publishers.items()
        ]


class Topic:
    """The door of one topic with its sender, and what has come through it."""

    def __init__(self, *, several: bool = False, **publishers: int) -> None:
        """Let these nodes publish on it; the controller is to, or with ``several`` the plant too."""
        self.graph = FakeGraph(**publishers)
        node: Any = self.graph
        self.sender = PublisherIdentity(node, "/joint_command", ("plant", "controller"), several=several)
        self.taken: list[int] = []
        self.message_filter = MessageFilter(lambda line: None, lambda topic, error: None)
        self._deliver = self.message_filter.wrap(
            "t", lambda data, sent_ns: self.taken.append(sent_ns), lambda data: None, self.sender
        )

    def come(self, *publishers: int) -> list[int]:
        """Return of which of these publishers a message is taken, one after the other."""
        self.taken.clear()
        for number in publishers:
            self._deliver(b"", number, bytes([number] * 16))
        return list(self.taken)


def test_only_messages_of_the_own_publisher_are_taken() -> None:
    topic = Topic(controller=1)
    assert topic.come(1, 1) == [1, 1]
    topic.graph.publishers["intruder"] = 2
    assert topic.come(2, 1, 2, 2, 1) == [1, 1]
    assert topic.message_filter.counts == {"t: second publisher": 3}
    assert topic.sender.others == ["/intruder"]


def test_a_flood_does_not_ask_discovery_again_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    topic = Topic(controller=1, intruder=2)
    topic.come(1, 2)
    monkeypatch.delattr(FakeGraph, "get_publishers_info_by_topic")
    assert topic.come(1, 2, 2, 1) == [1, 1]


def test_a_publisher_that_is_gone_again_is_refused() -> None:
    topic = Topic(controller=1)
    topic.come(1)
    assert topic.come(2) == []  # as of `ros2 topic pub --once`
    topic.graph.publishers.clear()
    assert topic.come(2, 1) == [1]


def test_a_publisher_made_anew_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    topic = Topic(controller=1)
    topic.come(1)
    two = FakeGraph(controller=1).get_publishers_info_by_topic("")
    two += FakeGraph(controller=2).get_publishers_info_by_topic("")
    monkeypatch.setattr(topic.graph, "get_publishers_info_by_topic", lambda name: two)
    assert topic.come(2, 2) == []  # discovery has both for a moment
    del two[0]
    assert topic.come(2, 2, 1) == [2, 2]


def test_messages_may_come_before_the_name_of_their_publisher() -> None:
    topic = Topic()
    assert topic.come(1) == [1]
    topic.graph.publishers = {"_NODE_NAME_UNKNOWN_": 1}
    assert topic.come(1) == [1]
    topic.graph.publishers = {"intruder": 2, "controller": 1}
    assert topic.come(2, 1) == [1]


def test_who_has_no_name_yet_does_not_count_beside_the_own_publisher() -> None:
    topic = Topic(controller=1, _NODE_NAME_UNKNOWN_=2)
    assert topic.come(1, 2) == [1]
    topic.graph.publishers = {"controller": 1, "intruder": 2}
    assert topic.come(2) == []
    assert topic.message_filter.counts == {"t: second publisher": 2}


def test_a_stranger_alone_does_not_count() -> None:
    assert Topic(intruder=2).come(2) == []


def test_a_second_node_of_the_same_name_is_another(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = (FakeGraph(controller=number).get_publishers_info_by_topic("") for number in (1, 2))
    topic = Topic(controller=1)
    topic.come(1)
    monkeypatch.setattr(topic.graph, "get_publishers_info_by_topic", lambda name: other + one)
    assert topic.sender.others == ["/controller"]
    assert topic.come(2, 1) == [1]


def test_of_several_nodes_each_has_one_publisher_that_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    topic = Topic(several=True, controller=1, _NODE_NAME_UNKNOWN_=2)
    assert topic.come(1, 2) == [1, 2]
    topic.graph.publishers = {"controller": 1, "plant": 2, "intruder": 3}
    assert topic.come(3, 1, 2, 3) == [1, 2]
    assert topic.sender.others == ["/intruder"]
    there = topic.graph.get_publishers_info_by_topic("")
    twin = FakeGraph(plant=4).get_publishers_info_by_topic("")
    monkeypatch.setattr(topic.graph, "get_publishers_info_by_topic", lambda name: twin + there)
    assert topic.come(4, 2) == [2]


def test_without_identifiers_every_message_is_taken() -> None:
    topic = Topic(controller=1, intruder=2)
    topic._deliver(b"", 5, b"")
    assert topic.taken == [5]


# The whole graph


def spoilt_joints(data: bytes) -> Iterator[tuple[Reason, bytes]]:
    """Yield a JointState of the loop in every way that it can be wrong."""

    def message() -> Any:
        return deserialize_message(data, JointState)

    for value in (np.nan, np.inf):
        bad = message()
        for block in (bad.position, bad.velocity, bad.effort):
            if block:
                block[-1] = value
        yield Reason.NOT_FINITE, serialize_message(bad)
    bad = message()
    bad.name = [f"other_{name}" for name in bad.name]
    yield Reason.NAMES, serialize_message(bad)
    bad = message()
    bad.name = [*list(bad.name)[:-1], bad.name[0]]
    yield Reason.NAMES, serialize_message(bad)
    bad = message()
    bad.name = [*bad.name, bad.name[0]]
    for block in ("position", "velocity", "effort"):
        if getattr(bad, block):
            setattr(bad, block, [*getattr(bad, block), 1.0])
    yield Reason.NAMES, serialize_message(bad)
    bad = message()
    bad.position, bad.velocity, bad.effort = [], [], []
    yield Reason.LENGTHS, serialize_message(bad)
    yield Reason.LENGTHS, with_(message(), name=list(message().name)[:-1])
    yield Reason.MALFORMED, data[: len(data) // 2]
    yield Reason.MALFORMED, data[:7]
    yield Reason.MALFORMED, data + bytes(100_000)
    yield Reason.MALFORMED, data[:4] + b"\xff" * (len(data) - 4)


def spoilt_stamps(data: bytes, kind: Any) -> Iterator[tuple[Reason, bytes]]:
    """Yield a message with stamps that do not belong."""
    for reason, stamp_ns in ((Reason.FUTURE, 10**18), (Reason.FUTURE, 30_000_000_000), (Reason.OLD, 1)):
        bad = deserialize_message(data, kind)
        bad.header.stamp = time_message(stamp_ns)
        yield reason, serialize_message(bad)
    bad = deserialize_message(data, kind)
    bad.header.stamp.sec = -5
    yield Reason.OLD, serialize_message(bad)


def with_(message: Any, **values: Any) -> bytes:
    """Return the bytes of a message with some fields changed."""
    for name, value in values.items():
        setattr(message, name, value)
    data: bytes = serialize_message(message)
    return data


def spoilt_odometry(data: bytes) -> Iterator[tuple[Reason, bytes]]:
    """Yield an Odometry in every way that it can be wrong."""

    def message() -> Any:
        return deserialize_message(data, Odometry)

    bad = message()
    bad.pose.pose.orientation.w += 0.1
    yield Reason.NOT_UNIT, serialize_message(bad)
    bad = message()
    bad.twist.twist.linear.z = np.nan
    yield Reason.NOT_FINITE, serialize_message(bad)
    yield Reason.FRAME, with_(message(), child_frame_id="elsewhere")
    yield Reason.MALFORMED, data[:40]


def spoilt_phases(data: bytes) -> Iterator[tuple[Reason, bytes]]:
    """Yield a TaskPhase in every way that it can be wrong."""

    def message() -> Any:
        return deserialize_message(data, TaskPhaseMessage)

    good = {"arm": "arm_a", "grasp_frame": "grasp_a"}
    for wrong in ({"arm": "arm_c"}, {"grasp_frame": "nowhere"}, {"action": 7}, {"from_arm": "arm_c"}):
        command = GraspCommand(**{**good, **wrong})
        yield Reason.NAMES, with_(message(), commands=[command])
    yield Reason.MALFORMED, data[:20]


def spoil(graph: Graph) -> dict[str, int]:
    """Let every node publish bad messages by its own publishers; return how many are to be refused."""
    plant: Any = graph.nodes[PLANT]
    controller: Any = graph.nodes[CONTROLLER]
    trajectory: Any = graph.nodes[TRAJECTORY]
    outputs = plant._outputs._publish
    heard = graph.heard
    joints, odometry = (outputs[JOINT_STATES], outputs[BASE_ODOMETRY])
    plan: list[tuple[str, Any, Iterator[tuple[Reason, bytes]]]] = [
        (JOINT_COMMAND, controller._command.publish, spoilt_joints(heard[JOINT_COMMAND][-1])),
        (JOINT_COMMAND, controller._command.publish, spoilt_stamps(heard[JOINT_COMMAND][-1], JointState)),
        (JOINT_REFERENCE, trajectory._reference.publish, spoilt_joints(heard[JOINT_REFERENCE][-1])),
        (JOINT_STATES, joints, spoilt_joints(heard[JOINT_STATES][-1])),
        (JOINT_STATES, joints, spoilt_stamps(heard[JOINT_STATES][-1], JointState)),
        (BASE_ODOMETRY, odometry, spoilt_odometry(heard[BASE_ODOMETRY][-1])),
        (SAMPLED_JOINT_STATES, outputs[SAMPLED_JOINT_STATES], spoilt_joints(heard[SAMPLED_JOINT_STATES][-1])),
        (SAMPLED_BASE_ODOMETRY, outputs[SAMPLED_BASE_ODOMETRY], spoilt_odometry(heard[BASE_ODOMETRY][-1])),
        (TASK_PHASE, trajectory._phase.publish, spoilt_phases(heard[TASK_PHASE][-1])),
        (DEPUTY_POSE, outputs[DEPUTY_POSE], iter([(Reason.MALFORMED, heard[DEPUTY_POSE][-1][:30])])),
        (RUN_RECORDED, graph.ear.tell_raw, iter([(Reason.MALFORMED, b"\x00\x01\x00\x00\x01")])),
    ]
    expected: dict[str, int] = {}
    for topic, publish, messages in plan:
        for reason, data in messages:
            publish(data)
            kind = f"{topic}: {reason.value}"
            expected[kind] = expected.get(kind, 0) + (2 if topic == TASK_PHASE else 1)
    return expected


def refused(graph: Graph) -> dict[str, int]:
    """Return what all nodes have refused by kind."""
    total: dict[str, int] = {}
    for node in graph.nodes.values():
        for kind, count in node.message_filter.counts.items():
            total[kind] = total.get(kind, 0) + count
    return total


def end_of(graph: Graph) -> bytes:
    """Return the bits of the last state of the plant."""
    state = graph.plant._plant.state
    return state.q.tobytes() + state.v.tobytes()


@pytest.mark.ros
@pytest.mark.parametrize("transport", [DIRECT, EXECUTOR])
def test_bad_messages_change_no_bit_of_a_run(bench: Bench, transport: str) -> None:
    """In the middle of a run every node sends every kind of bad message; each is counted by its reason."""
    common = {"common": {"transport": transport}}
    clean = Graph(bench, common)
    clean.run()
    expected_end = end_of(clean)
    assert refused(clean) == {}
    bench.close()
    graph = Graph(bench, common)
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.report().stamp_ns >= 60_000_000, "tick 60")
    expected = spoil(graph)
    graph.wait_for_end()
    told_back = f"{RUN_RECORDED}: {Reason.OLD.value}"  # the ear follows a bad state with an old stamp
    assert {kind: count for kind, count in refused(graph).items() if kind != told_back} == expected
    assert end_of(graph) == expected_end
    events = [event for event in Messages().of(graph, RUN_EVENTS) if event.kind == "refused"]
    kinds = len(expected) + sum(kind.startswith(TASK_PHASE) for kind in expected)  # two nodes take phases
    assert len([event for event in events if told_back not in event.detail]) == kinds

    def keys() -> set[str]:
        told = Messages().of(graph, DIAGNOSTICS)
        return {value.key for message in told for value in message.status[0].values}

    bench.until(lambda: {f"refused {kind}" for kind in expected} <= keys(), "diagnostics that tell them all")


@pytest.mark.ros
def test_a_second_controller_is_refused_by_name(bench: Bench) -> None:
    """It sends good commands of the very stamp that is awaited, before and after the real one does."""
    common = {"common": {"transport": DIRECT}}
    clean = Graph(bench, common)
    clean.run()
    expected_end = end_of(clean)
    bench.close()
    graph = Graph(bench, common)
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.report().stamp_ns >= 20_000_000, "tick 20")
    intruder = bench.plain("intruder").create_publisher(JointState, JOINT_COMMAND, LOSSLESS)
    names = list(graph.plant.robot.joint_names)

    sent: list[int] = []

    def sent_enough() -> bool:
        now_ns = graph.plant.report().stamp_ns
        if now_ns in sent:  # it is not faster than the run, whose numbers it would catch up with
            return len(sent) > 100
        message = JointState(name=names, effort=[5.0] * len(names))
        message.header.stamp = time_message(now_ns)
        intruder.publish(message)
        sent.append(now_ns)
        return False

    bench.until(sent_enough, "a hundred commands")
    graph.wait_for_end()
    (refusal,) = refused(graph).items()
    assert refusal[0] == f"{JOINT_COMMAND}: second publisher" and refusal[1] > 50
    assert end_of(graph) == expected_end
    (event,) = (event for event in Messages().of(graph, RUN_EVENTS) if event.kind == "refused")
    assert "'/intruder' publishes too" in event.detail


@pytest.mark.ros
def test_where_senders_are_not_told_apart_a_second_controller_ends_the_run(bench: Bench) -> None:
    graph = Graph(bench, {"common": {"transport": EXECUTOR}})
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.report().stamp_ns >= 20_000_000, "tick 20")
    bench.plain("intruder").create_publisher(JointState, JOINT_COMMAND, LOSSLESS)
    bench.until(lambda: graph.plant.endpoints.other_publishers, "the second controller to be found")
    with pytest.raises(MessageError, match="'/intruder', which publishes joint_command too") as caught:
        graph.plant.publish_diagnostics()
    assert caught.value.reason is Reason.SENDER


@pytest.mark.ros
def test_a_run_does_not_begin_with_a_second_controller(bench: Bench) -> None:
    """And begins once it is gone."""
    graph = Graph(bench, {"common": {"transport": DIRECT}})
    intruder = bench.plain("intruder")
    publisher = intruder.create_publisher(JointState, JOINT_COMMAND, LOSSLESS)
    waiting = f"the end of node '/intruder', which publishes {JOINT_COMMAND} too"
    bench.until(lambda: graph.plant.endpoints.unmatched == [waiting], waiting)
    assert not graph.heard[RUN_STATE]
    intruder.destroy_publisher(publisher)
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.heard[RUN_STATE], "the begin of the run")
    assert Messages().of(graph, RUN_STATE)[0].state == RunState.RUNNING
