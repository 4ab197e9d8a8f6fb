"""Publisher identity: whose messages on a topic count, and not those of, say, a second controller."""

from collections.abc import Collection

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sms_handover.errors import MessageError, Reason
from sms_handover.ros.transport.rcl_take import IDENTITY

# The name of a publisher whose node discovery does not know yet; its messages may be here by then.
_NAMELESS = "_NODE_NAME_UNKNOWN_"


class PublisherIdentity:
    """The publishers whose messages on a topic count: of each node of the run one, or one in all.

    It is the first that discovery finds of such a node, as long as it exists. Against forged identifiers only
    DDS-Security helps.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        peers: Collection[str],
        *,
        several: bool = False,
        namespace: str | None = None,
    ) -> None:
        """Expect the messages of a topic, by its full name, from nodes among ``peers``.

        Where graphs have the topic in common the ``namespace`` tells their nodes apart.
        """
        self.own: frozenset[bytes] = frozenset()  # global identifiers of the publishers that are known
        self._node = node
        self._topic = topic
        self._peers = frozenset(peers)
        self._several = several
        self._namespace = namespace
        self._strangers: dict[bytes, str] = {}  # names by global identifier

    @property
    def others(self) -> list[str]:
        """The names of the nodes that publish on the topic but are not to."""
        return [_name(endpoint) for endpoint in self._split()[1]]

    def require(self, publisher: bytes) -> None:
        """Raise MessageError if a publisher, b"" if unknown, is none of the topic's own."""
        if not publisher:
            return
        name = self._strangers.get(publisher)
        if name is None:
            own, others = self._split()
            named = {_identity(endpoint) for endpoint in own if endpoint.node_name != _NAMELESS}
            if publisher in named:
                self.own = frozenset(named)
            if publisher in map(_identity, own) or self._may_be_early(publisher, own, others):
                return
            name = self._name_of(publisher, others)
        raise MessageError(Reason.SENDER, f"node {name} publishes too, whose messages do not count")

    def _may_be_early(
        self, publisher: bytes, own: list[TopicEndpointInfo], others: list[TopicEndpointInfo]
    ) -> bool:
        """Whether a message may be here before discovery has found its publisher."""
        if self._several:
            return publisher not in map(_identity, others)
        return not (self.own or own or others)

    def _name_of(self, publisher: bytes, others: list[TopicEndpointInfo]) -> str:
        """Return the name of a publisher for a message, and remember strangers for good."""
        for endpoint in others:
            if _identity(endpoint) == publisher:
                name = repr(_name(endpoint))
                if not self._is_peer(endpoint) and endpoint.node_name != _NAMELESS:
                    self._strangers[publisher] = name
                return name
        return "that has ended"

    def _split(self) -> tuple[list[TopicEndpointInfo], list[TopicEndpointInfo]]:
        """Return the publishers that count, as far as they are there, and all others."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        there.sort(key=lambda endpoint: _identity(endpoint) not in self.own)
        by_node: dict[str, TopicEndpointInfo] = {}
        for endpoint in there:
            if self._is_peer(endpoint):
                by_node.setdefault(endpoint.node_name, endpoint)
        own = list(by_node.values())
        nameless = [endpoint for endpoint in there if endpoint.node_name == _NAMELESS]
        own = own + nameless if self._several else (own or nameless)[:1]
        return own, [endpoint for endpoint in there if endpoint not in own]

    def _is_peer(self, endpoint: TopicEndpointInfo) -> bool:
        """Whether an endpoint belongs to a node of the run, by its name."""
        here = self._namespace in (None, endpoint.node_namespace)
        return here and endpoint.node_name in self._peers


def _identity(endpoint: TopicEndpointInfo) -> bytes:
    return bytes(endpoint.endpoint_gid[:IDENTITY])


def _name(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of the node that an endpoint belongs to."""
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
