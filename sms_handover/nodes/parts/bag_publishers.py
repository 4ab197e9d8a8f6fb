"""Publishers for the topics of a bag: with the recorded QoS, and without dropping messages."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from rclpy.duration import Duration, Infinite
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)

from sms_handover.bag.info import TopicInfo
from sms_handover.bag.qos import History, Reliability
from sms_handover.errors import GraphError
from sms_handover.messages.message_types import MessageTypes
from sms_handover.playback.definitions import same_definition
from sms_handover.playback.qos import Offer, read_offer, with_policies
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import serves

_RclError = rclpy_implementation.RCLError

_LATCHED_DEPTH = 100  # [messages] kept at most if the bag does not tell the depth
_ACK_POLL = Duration(seconds=0.02)  # of wall time between services and keys


class BagPublisher:
    """Publisher of one topic of a bag; a late subscriber receives ``kept`` messages of it."""

    def __init__(self, node: Node, topic: TopicInfo, offer: Offer) -> None:
        """Advertise the topic; raises GraphError if its type is not installed."""
        self.name = topic.name
        self.profile = profile_for(offer, topic.message_count)
        self._depth = self.profile.depth if offer.latched else 0
        self.kept = (self._depth or topic.message_count) if offer.latched else 0
        self._reliable = offer.reliability is Reliability.RELIABLE
        self._publisher = node.create_publisher(message_class(topic.type), topic.name, self.profile)
        self._unacknowledged = 0

    @property
    def topic_name(self) -> str:
        """Return the name on the graph, after remapping."""
        return str(self._publisher.topic_name)

    @property
    def subscription_count(self) -> int:
        """Return the number of matched subscriptions."""
        return int(self._publisher.get_subscription_count())

    def publish(self, data: bytes) -> bool:
        """Publish CDR bytes; return False, with nothing published, while a subscriber is too far behind.

        A volatile topic has KEEP_ALL history, whose full queue rejects the message. A latched one keeps
        the latest few, so it waits for all acknowledgements before it would replace one of them.
        """
        if self._depth and self._reliable and self._unacknowledged >= self._depth:
            if not self.acknowledged(_ACK_POLL):
                return False
            self._unacknowledged = 0
        try:
            self._publisher.publish(data)
        except _RclError:
            return False
        self._unacknowledged += 1
        return True

    def acknowledged(self, timeout: Duration) -> bool:
        """Wait for all acknowledgements; return False after the timeout."""
        return bool(self._publisher.wait_for_all_acked(timeout))

    def waits_for_match(self, node: Node) -> bool:
        """Whether a compatible subscription is known that has not matched yet."""
        known = node.get_subscriptions_info_by_topic(self.topic_name)
        return self.subscription_count < sum(serves(self.profile, item.qos_profile) for item in known)


def make_publishers(
    node: Node, topics: Iterable[TopicInfo], overrides: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, BagPublisher], dict[str, str]]:
    """Return the publishers by recorded topic, and the reasons by topic that cannot be played.

    ``overrides`` are QoS policies by topic that replace the recorded ones.
    """
    types = MessageTypes()
    publishers: dict[str, BagPublisher] = {}
    skipped: dict[str, str] = {}
    for topic in topics:
        try:
            _check(topic, types)
            where = f"QoS override of {topic.name}"
            offer = with_policies(read_offer(topic.qos), overrides.get(topic.name, {}), where)
            publishers[topic.name] = BagPublisher(node, topic, offer)
        except GraphError as error:
            skipped[topic.name] = str(error)
    return publishers, skipped


def profile_for(offer: Offer, message_count: int) -> QoSProfile:
    """Return the recorded profile with a history that drops nothing."""
    history, depth = QoSHistoryPolicy.KEEP_ALL, 0
    if offer.latched and offer.history is not History.KEEP_ALL:
        known = offer.history is History.KEEP_LAST and offer.depth > 0
        history = QoSHistoryPolicy.KEEP_LAST
        depth = offer.depth if known else max(1, min(message_count, _LATCHED_DEPTH))
    return QoSProfile(
        history=history,
        depth=depth,
        reliability=getattr(QoSReliabilityPolicy, offer.reliability.name),
        durability=getattr(QoSDurabilityPolicy, offer.durability.name),
        deadline=_duration(offer.deadline_ns),
        lifespan=_duration(offer.lifespan_ns),
        liveliness=getattr(QoSLivelinessPolicy, offer.liveliness.name),
        liveliness_lease_duration=_duration(offer.lease_ns),
    )


def without_subscriber(publishers: Collection[BagPublisher]) -> list[str]:
    """Return the topics without a subscriber."""
    return [publisher.topic_name for publisher in publishers if publisher.subscription_count == 0]


def _check(topic: TopicInfo, types: MessageTypes) -> None:
    """Raise GraphError if a topic cannot be published with the installed definition of its type."""
    if topic.encoding != "cdr":
        raise GraphError(f"its messages are encoded as {topic.encoding!r}, must be 'cdr'")
    message_class(topic.type)
    if not same_definition(topic, types):
        raise GraphError(f"it was recorded with another definition of {topic.type} than the installed one")


def _duration(time_ns: int | None) -> Duration:
    """Return a duration, infinite for None."""
    return Infinite if time_ns is None else Duration(nanoseconds=time_ns)
