"""Whatever way the inputs of a loop come: every one of them, in order, with the same bytes."""

from collections.abc import Callable, Iterator
from time import monotonic, time_ns
from typing import Any

import pytest
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from std_srvs.srv import SetBool

from sms_handover.ros.qos import LATCHED, LOSSLESS
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.inputs import ExecutorInputs, Inputs

from .bench import DEADLINE_S, Bench

pytestmark = pytest.mark.ros

COUNT = 2000


class Loop:
    """A node with inputs of one kind, spun as a node of the graph is."""

    def __init__(self, bench: Bench, make: Callable[[Node], Inputs]) -> None:
        """Make the node; it is given to an executor with the first turn, when its inputs are there."""
        bench.start()
        self.bench = bench
        self.node = bench.loose("listener")
        self.inputs = make(self.node)
        self.executor = EventsExecutor()
        self._added = False

    def until(self, condition: Callable[[], object], awaited: str = "") -> None:
        """Spin until a condition holds."""
        if not self._added:
            self.executor.add_node(self.node)
            self._added = True
        self.inputs.awaited = lambda: awaited
        deadline = monotonic() + DEADLINE_S
        while not condition():
            assert monotonic() < deadline
            self.inputs.spin_once(self.executor, 0.05)


@pytest.fixture(params=[DirectInputs, ExecutorInputs])
def loop(request: pytest.FixtureRequest, bench: Bench) -> Iterator[Loop]:
    loop = Loop(bench, request.param)
    yield loop
    loop.inputs.destroy()


def test_every_message_is_handed_over_in_order(loop: Loop) -> None:
    publisher = loop.bench.loose("speaker").create_publisher(String, "topic", LOSSLESS)
    taken: list[tuple[bytes, int, bytes]] = []
    subscription = loop.inputs.subscribe(String, "topic", LOSSLESS, lambda *message: taken.append(message))
    loop.until(lambda: publisher.get_subscription_count() == 1 == subscription.get_publisher_count())
    assert loop.inputs.poll() == 0
    begin_ns = time_ns()
    sent = [serialize_message(String(data=f"{number:08}")) for number in range(COUNT)]
    for data in sent:
        publisher.publish(data)
    loop.until(lambda: len(taken) == COUNT, "topic")
    assert [data for data, _, _ in taken] == sent
    assert loop.inputs.poll() == 0
    times = [sent_ns for _, sent_ns, _ in taken]
    (endpoint,) = loop.node.get_publishers_info_by_topic("topic")
    known = isinstance(loop.inputs, DirectInputs)
    assert {publisher for _, _, publisher in taken} == {bytes(endpoint.endpoint_gid) if known else b""}
    assert begin_ns <= times[0] and times == sorted(times) and times[-1] <= time_ns()


def test_several_topics_come_at_once(loop: Loop) -> None:
    heard: dict[str, list[bytes]] = {"one": [], "two": []}
    speaker = loop.bench.loose("speaker")
    for name, messages in heard.items():
        speaker.create_publisher(String, name, LATCHED).publish(String(data=name))

        def keep(data: bytes, sent_ns: int, publisher: bytes, into: list[bytes] = messages) -> None:
            into.append(data)

        loop.inputs.subscribe(String, name, LATCHED, keep)
    loop.until(lambda: all(heard.values()), "one")
    assert [len(messages) for messages in heard.values()] == [1, 1]
    assert all(name.encode() in messages[0] for name, messages in heard.items())


def test_requests_are_answered_in_order(bench: Bench) -> None:
    """Each of both kinds asks the other kind and its own."""
    bench.start()
    executor = EventsExecutor()
    loops: list[Inputs] = []
    answers: dict[str, list[str]] = {}
    askers = {}
    for make in (DirectInputs, ExecutorInputs):
        server = bench.loose(f"server_{make.__name__}")
        inputs: Inputs = make(server)
        service = f"twice_{make.__name__}"

        def answer(request: Any, service: str = service) -> Any:
            return SetBool.Response(success=request.data, message=service)

        inputs.create_service(SetBool, service, answer)
        loops.append(inputs)
        executor.add_node(server)
        for kind in (DirectInputs, ExecutorInputs):
            client = bench.loose(f"client_{make.__name__}_{kind.__name__}")
            loops.append(kind(client))
            name = client.get_name()
            answers[name] = []

            def keep(response: Any, name: str = name) -> None:
                answers[name].append(f"{response.message} {response.success}")

            askers[name] = loops[-1].create_client(SetBool, service, keep)
            executor.add_node(client)

    def until(condition: Callable[[], object]) -> None:
        deadline = monotonic() + DEADLINE_S
        while not condition():
            assert monotonic() < deadline
            executor.spin_once(timeout_sec=0.001)
            for inputs in loops:
                inputs.poll()

    until(lambda: all(asker.service_is_ready() for asker in askers.values()))
    for asker in askers.values():
        for number in range(5):
            asker.call(SetBool.Request(data=number % 2 == 0))
    until(lambda: all(len(found) == 5 for found in answers.values()))
    for name, found in answers.items():
        service = f"twice_{name.split('_')[1]}"
        assert found == [f"{service} {number % 2 == 0}" for number in range(5)]
    for inputs in loops:
        inputs.destroy()


def test_the_executor_gets_its_turn_while_the_loop_runs(bench: Bench) -> None:
    """Messages come without end, and a timer still fires."""
    loop = Loop(bench, DirectInputs)
    publisher = bench.loose("speaker").create_publisher(String, "topic", LOSSLESS)
    taken: list[bytes] = []
    fired: list[int] = []

    def again(data: bytes, sent_ns: int, sender: bytes) -> None:
        taken.append(data)
        publisher.publish(String(data=str(len(taken))))

    subscription = loop.inputs.subscribe(String, "topic", LOSSLESS, again)
    loop.node.create_timer(0.01, lambda: fired.append(len(taken)))
    loop.until(lambda: publisher.get_subscription_count() == 1 == subscription.get_publisher_count())
    publisher.publish(String(data="0"))
    fired.clear()
    loop.until(lambda: len(fired) >= 3, "topic")
    assert len(taken) > 3


@pytest.mark.parametrize("make", [DirectInputs, ExecutorInputs])
def test_a_loop_that_keeps_the_processor_misses_nothing(bench: Bench, make: Callable[[Node], Inputs]) -> None:
    """It never sleeps, as in real time before a deadline: messages come, and a timer fires."""
    loop = Loop(bench, make)
    publisher = bench.loose("speaker").create_publisher(String, "topic", LOSSLESS)
    taken: list[bytes] = []
    fired: list[int] = []
    subscription = loop.inputs.subscribe(String, "topic", LOSSLESS, lambda *message: taken.append(message[0]))
    loop.until(lambda: publisher.get_subscription_count() == 1 == subscription.get_publisher_count())
    loop.node.create_timer(0.01, lambda: fired.append(len(taken)))
    for number in range(COUNT):
        publisher.publish(String(data=str(number)))
    deadline = monotonic() + DEADLINE_S
    while len(taken) < COUNT or len(fired) < 3:
        assert monotonic() < deadline
        loop.inputs.spin_some(loop.executor)
        loop.inputs.give_turn(loop.executor)


def test_what_is_given_back_is_gone(bench: Bench) -> None:
    loop = Loop(bench, DirectInputs)
    publisher = bench.plain("speaker").create_publisher(String, "topic", LOSSLESS)
    loop.inputs.subscribe(String, "topic", LOSSLESS, lambda data, sent_ns, publisher: None)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the subscription")
    loop.inputs.destroy()
    bench.until(lambda: publisher.get_subscription_count() == 0, "the end of the subscription")
