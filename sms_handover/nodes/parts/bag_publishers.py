"""Publishers for the topics of a bag: with the recorded QoS, and without dropping messages."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from rclpy.duration import Duration, Infinite
from rclpy.exceptions import NameValidationException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)
from rclpy.validate_full_topic_name import validate_full_topic_name

from sms_handover.bag.info import TopicInfo
from sms_handover.bag.qos import History, Reliability
from sms_handover.bag.topic_choice import absolute
from sms_handover.errors import GraphError
from sms_handover.messages.message_types import MessageTypes
from sms_handover.playback.definitions import same_definition
from sms_handover.playback.qos import Offer, read_offer, with_policies
from sms_handover.playback.source import TopicKey
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import serves

_RclError = rclpy_implementation.RCLError

_LATCHED_DEPTH = 100  # [messages] kept at most if the bag does not tell the depth
_ACK_POLL = Duration(seconds=0.02)  # of wall time between services and keys


class BagPublisher:
    """Publisher of one topic of a bag; a late subscriber receives ``kept`` messages of it."""

    def __init__(self, node: Node, same: Sequence[TopicInfo], offer: Offer, name: str) -> None:
        """Advertise the channels of one topic and type under a name."""
        self.name, self.type = same[0].name, same[0].type
        self.message_count = sum(topic.message_count for topic in same)
        self.profile = profile_for(offer, self.message_count)
        self._depth = self.profile.depth if offer.latched else 0
        self.kept = (self._depth or self.message_count) if offer.latched else 0
        self._reliable = offer.reliability is Reliability.RELIABLE
        self._node = node
        self._publisher = node.create_publisher(message_class(self.type), name, self.profile)
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

    def waits_for_match(self) -> bool:
        """Whether a compatible subscription is known that has not matched yet."""
        known = self._node.get_subscriptions_info_by_topic(self.topic_name)
        own = [item.qos_profile for item in known if item.topic_type == self._type_here]
        return self.subscription_count < sum(serves(self.profile, profile) for profile in own)

    def conflict(self) -> str:
        """Return why another node keeps this topic from being published, '' if none does."""
        known = self._node.get_publishers_info_by_topic(self.topic_name)
        others = sorted({item.topic_type for item in known} - {self._type_here})
        return f"{self.topic_name} is published with type {', '.join(others)} already" if others else ""

    def destroy(self) -> None:
        """Remove the topic from the graph."""
        self._node.destroy_publisher(self._publisher)

    @property
    def _type_here(self) -> str:
        """Return the type as the graph names it."""
        package, _, rest = self.type.partition("/")
        return self.type if "/" in rest else f"{package}/msg/{rest}"


def make_publishers(
    node: Node,
    topics: Iterable[TopicInfo],
    overrides: Mapping[str, Mapping[str, Any]],
    renamed: Mapping[str, str],
) -> tuple[dict[TopicKey, BagPublisher], dict[TopicKey, str]]:
    """Return the publishers of the topics that can be played, and the reasons for the others.

    ``overrides`` are QoS policies by topic that replace the recorded ones, ``renamed`` other names. What
    one topic has wrong keeps no other from being played.
    """
    types = MessageTypes()
    by_key: dict[TopicKey, list[TopicInfo]] = {}
    for topic in topics:
        by_key.setdefault((topic.name, topic.type), []).append(topic)
    publishers: dict[TopicKey, BagPublisher] = {}
    skipped: dict[TopicKey, str] = {}
    for key, same in by_key.items():
        try:
            name = renamed.get(absolute(key[0]), key[0])
            _check(same, name, types)
            _require_free(node.resolve_topic_name(absolute(name)), key[1], publishers.values())
            where = f"QoS override of {key[0]}"
            offer = with_policies(read_offer(same[0].qos), overrides.get(key[0], {}), where)
            publishers[key] = BagPublisher(node, same, offer, absolute(name))
        except NameValidationException as error:
            skipped[key] = f"{str(error).splitlines()[0]}; give it another name with --remap"
        except Exception as error:  # whatever it is, it is about this topic alone
            skipped[key] = " ".join(str(error).split(", at /", 1)[0].split())  # without places in rcl
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


def _check(same: Sequence[TopicInfo], name: str, types: MessageTypes) -> None:
    """Raise an error if a topic cannot be published under a name, with the installed type."""
    validate_full_topic_name(absolute(name))
    for topic in same:
        if topic.encoding != "cdr":
            raise GraphError(f"its messages are encoded as {topic.encoding!r}, must be 'cdr'")
        message_class(topic.type)
        if not same_definition(topic, types):
            raise GraphError(f"its definition of {topic.type} is not the installed one")


def _require_free(name: str, type_name: str, publishers: Iterable[BagPublisher]) -> None:
    """Raise GraphError if a topic is published with another type: one process cannot publish both."""
    taken = next((item.type for item in publishers if item.topic_name == name), type_name)
    if taken != type_name:
        raise GraphError(f"its type is {type_name}, but {name} is published with type {taken} already")


def _duration(time_ns: int | None) -> Duration:
    """Return a duration, infinite for None."""
    return Infinite if time_ns is None else Duration(nanoseconds=time_ns)
