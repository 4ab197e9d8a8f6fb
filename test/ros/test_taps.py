"""Taps leave messages in the middleware until they are asked, and then hand over every one of them."""

from time import time_ns

import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from sms_handover.ros.qos import LATCHED, LOSSLESS
from sms_handover.ros.taps import Taps

from .bench import Bench

pytestmark = pytest.mark.ros

COUNT = 2000


def test_every_message_is_handed_over_in_order(bench: Bench) -> None:
    bench.start()
    speaker = bench.plain("speaker")
    listener = bench.loose("listener")
    by_executor: list[object] = []
    taken: list[tuple[bytes, int]] = []
    taps = Taps(listener)
    subscription = listener.create_subscription(String, "topic", by_executor.append, LOSSLESS, raw=True)
    taps.take_over(subscription, lambda data, sent_ns: taken.append((data, sent_ns)))
    bench.spin(listener)
    publisher = speaker.create_publisher(String, "topic", LOSSLESS)
    bench.until(
        lambda: publisher.get_subscription_count() == 1 == subscription.get_publisher_count(), "the match"
    )
    assert taps.empty() == 0
    begin_ns = time_ns()
    sent = [serialize_message(String(data=f"{number:08}")) for number in range(COUNT)]
    for data in sent:
        publisher.publish(data)
    counted = 0

    def empty() -> bool:
        nonlocal counted
        counted += taps.empty()
        return counted == COUNT

    bench.until(empty, "every message")
    assert [data for data, _ in taken] == sent
    assert taps.empty() == 0
    assert by_executor == []
    times = [sent_ns for _, sent_ns in taken]
    assert begin_ns <= times[0] and times == sorted(times) and times[-1] <= time_ns()
    taps.destroy()
    bench.until(lambda: publisher.get_subscription_count() == 0, "the end of the subscription")


def test_several_topics_are_emptied_at_once(bench: Bench) -> None:
    bench.start()
    speaker = bench.plain("speaker")
    listener = bench.loose("listener")
    taps = Taps(listener)
    heard: dict[str, list[bytes]] = {"one": [], "two": []}
    for name, messages in heard.items():
        speaker.create_publisher(String, name, LATCHED).publish(String(data=name))
        subscription = listener.create_subscription(String, name, lambda data: None, LATCHED, raw=True)

        def keep(data: bytes, sent_ns: int, into: list[bytes] = messages) -> None:
            into.append(data)

        taps.take_over(subscription, keep)
    bench.until(lambda: taps.empty() >= 0 and all(heard.values()), "the messages")
    assert all(name.encode() in messages[0] for name, messages in heard.items())
    taps.destroy()
