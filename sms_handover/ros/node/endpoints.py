"""Endpoints of a node: its publishers and subscriptions, made from the table of topics and counted."""

from collections.abc import Callable, Collection
from time import monotonic, sleep
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sms_handover.errors import GraphError
from sms_handover.graph.topics import RECORDER, Rate, Topic
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import profile_of, serves
from sms_handover.ros.transport.inputs import Inputs, OnSerialized
from sms_handover.ros.transport.publisher_identity import PublisherIdentity

_Found = Collection[TopicEndpointInfo]
_RclError = rclpy_implementation.RCLError

_RETRY_S = 0.001  # [s] between two tries to publish while a reader is behind
_TIMEOUT_S = 30.0  # [s] after which a reader that takes nothing is given up


class Endpoints:
    """Makes a node's publishers and subscriptions, finds when all have matched, counts what it publishes."""

    def __init__(
        self, node: Node, topics: Collection[Topic], peers: Collection[str], external: Collection[str] = ()
    ) -> None:
        """Prepare for a node among ``peers``, which are the nodes that take part in this run.

        Those that are ``external`` need only the endpoints of topics with a message every tick; what
        else they have must have matched too, and they have made it before they publish on such a topic.
        """
        self._node = node
        self._topics = {topic.name: topic for topic in topics}
        self._peers = frozenset(peers)
        self._external = frozenset(external) - {node.get_name()}
        self._publishers: dict[str, CountedPublisher] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._identities: dict[str, PublisherIdentity] = {}

    def publisher(self, name: str) -> "CountedPublisher":
        """Return a publisher on a topic of the table."""
        topic = self._topics[name]
        publisher = self._node.create_publisher(message_class(topic.type), topic.name, profile_of(topic))
        self._publishers[name] = CountedPublisher(publisher)
        return self._publishers[name]

    def subscribe_serialized(self, name: str, inputs: Inputs, on_data: OnSerialized) -> None:
        """Hand every message of a topic of the table to ``on_data`` by the inputs of a node's loop."""
        topic = self._topics[name]
        self._subscriptions[name] = inputs.subscribe(
            message_class(topic.type), topic.name, profile_of(topic), on_data
        )

    def identity(self, name: str) -> PublisherIdentity:
        """Return what knows the publishers of a topic that count.

        From now on the endpoints count as unmatched as long as somebody else publishes on the topic.
        """
        several = len(self._topics[name].publishers) > 1
        full_name = self._node.resolve_topic_name(name)
        self._identities[name] = PublisherIdentity(self._node, full_name, self._peers, several=several)
        return self._identities[name]

    def own_of_global(self, name: str) -> PublisherIdentity:
        """Return what knows the publishers of this graph on a global topic, where others may publish too."""
        namespace = self._node.get_namespace()
        return PublisherIdentity(self._node, name, self._peers, several=True, namespace=namespace)

    @property
    def other_publishers(self) -> list[str]:
        """Which other nodes publish where one alone is to, in words."""
        return [
            f"the end of node {other!r}, which publishes {name} too"
            for name, identity in self._identities.items()
            for other in identity.others
        ]

    def subscribe(self, name: str, callback: Callable[[Any], None], *, raw: bool = False) -> Subscription:
        """Call ``callback`` with every message of a topic of the table, as CDR bytes if ``raw``."""
        topic = self._topics[name]
        subscription = self._node.create_subscription(
            message_class(topic.type), topic.name, callback, profile_of(topic), raw=raw
        )
        self._subscriptions[name] = subscription
        return subscription

    @property
    def unmatched(self) -> list[str]:
        """What has not been found yet of the endpoints of the peers, in words."""
        me, node = {self._node.get_name()}, self._node
        missing: list[str] = []
        for name, publisher in self._publishers.items():
            topic, profile = self._topics[name], profile_of(self._topics[name])
            readers = node.get_subscriptions_info_by_topic(publisher.topic_name)
            served = [reader for reader in readers if serves(profile, reader.qos_profile)]
            nodes = {*topic.subscribers} - me | {RECORDER}
            missing += self._missing("subscriptions", topic, publisher.subscription_count, served, nodes)
        for name, subscription in self._subscriptions.items():
            topic, profile = self._topics[name], profile_of(self._topics[name])
            writers = node.get_publishers_info_by_topic(subscription.topic_name)
            serving = [writer for writer in writers if serves(writer.qos_profile, profile)]
            matched, nodes = subscription.get_publisher_count(), {*topic.publishers} - me
            missing += self._missing("publishers", topic, matched, serving, nodes)
        return missing + self._absent or self.other_publishers

    def _missing(self, kind: str, topic: Topic, matched: int, there: _Found, nodes: set[str]) -> list[str]:
        """Return how many of the endpoints of some nodes have matched, in words, unless all have."""
        names = [self._known_as(topic, endpoint) for endpoint in there]
        wanted = self._wanted(topic, nodes, names)
        found = _found(matched, names, wanted)
        return [f"{found} of {len(wanted)} {kind} of {topic.name}"] if found < len(wanted) else []

    def not_publishing(self, name: str) -> frozenset[str]:
        """Return the external nodes that have no publisher on a topic."""
        there = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(name))
        return self._external - {writer.node_name for writer in there}

    @property
    def _absent(self) -> list[str]:
        """Which external nodes have not appeared, on topics that this node does not read, in words."""
        return [
            f"the external node {name!r}, which publishes {topic.name}"
            for topic in self._topics.values()
            if topic.rate is Rate.TICK and topic.name not in self._subscriptions
            for name in sorted(self.not_publishing(topic.name).intersection(topic.publishers))
        ]

    def _known_as(self, topic: Topic, endpoint: TopicEndpointInfo) -> str:
        """Return the name of the node of an endpoint, with its namespace if it is of another graph."""
        if topic.is_global and endpoint.node_namespace != self._node.get_namespace():
            return f"{endpoint.node_namespace}/{endpoint.node_name}"
        return str(endpoint.node_name)

    def _wanted(self, topic: Topic, nodes: set[str], there: Collection[str]) -> frozenset[str]:
        """Return the nodes whose endpoint on a topic has to match.

        They are the peers among ``nodes``; of the external ones those that are ``there``, whatever the
        table says, and in any case where the topic has a message every tick.
        """
        wanted = self._peers.intersection(nodes)
        if not self._external:
            return wanted
        here = set(there)
        if topic.rate is Rate.TICK:
            here |= wanted
        return (wanted - self._external) | (self._external & here)

    @property
    def counts(self) -> dict[str, int]:
        """How many messages have been published on each topic, by its full name."""
        return {publisher.topic_name: publisher.count for publisher in self._publishers.values()}

    def reset_run(self) -> None:
        """Count the messages of a new run."""
        for publisher in self._publishers.values():
            publisher.count = 0

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Every topic of the graph."""
        return tuple(self._topics.values())


def _found(matched: int, names: Collection[str], wanted: Collection[str]) -> int:
    """Return how many of the wanted nodes' endpoints have surely matched.

    The middleware tells only how many have matched, not which; so others that are there too, such as those of
    a display, are taken to have matched before the wanted ones.
    """
    others = sum(name not in wanted for name in names)
    return max(0, min(len(set(names).intersection(wanted)), matched - others))


class CountedPublisher:
    """A publisher that counts, and waits when a reader is too far behind."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self.count = 0

    @property
    def topic_name(self) -> str:
        """Return the full name of the topic."""
        return str(self._publisher.topic_name)

    @property
    def subscription_count(self) -> int:
        """Return the number of matched subscriptions."""
        return int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Publish a message or CDR bytes; raises GraphError if a reader takes nothing for a long time.

        With KEEP_ALL history a full queue rejects the message; that is the back-pressure, so it is retried.
        """
        begin = 0.0
        while True:
            try:
                self._publisher.publish(message)
            except _RclError as error:
                begin = begin or monotonic()
                if monotonic() - begin > _TIMEOUT_S:
                    raise GraphError(f"a reader of {self.topic_name} is stuck: {error}") from error
                sleep(_RETRY_S)
            else:
                self.count += 1
                return
