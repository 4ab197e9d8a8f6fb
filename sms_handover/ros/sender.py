"""Tells the messages of a topic's own publisher from those of any other, such as a second controller."""

from collections.abc import Collection

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sms_handover.errors import GraphError, MessageError, Reason

# The name that a publisher has as long as discovery has not told its node; its messages may be here by then.
_NAMELESS = "_NODE_NAME_UNKNOWN_"


class Sender:
    """The one publisher whose messages on a topic count.

    The middleware numbers the messages of each publisher from 1 on, but rclpy does not tell which
    publisher a message is from. So a message is taken for one of the publisher's own while the numbers
    go on one by one; where they do not, it is looked at who else publishes, and from then on the
    numbers of the others are followed too. Should they meet those of the publisher the messages
    cannot be told apart any more. Against one that forges numbers only DDS-Security helps.
    """

    def __init__(self, node: Node, topic: str, peers: Collection[str]) -> None:
        """Expect the messages of a topic, by its full name, from one of the nodes ``peers``."""
        self.due = 0  # number of the next message of the publisher, 0 before the first
        self._node = node
        self._topic = topic
        self._peers = frozenset(peers)
        self._own: tuple[int, ...] | None = None  # global identifier of the publisher once it is known
        self._others_due: set[int] = set()  # numbers of the next messages of others
        self._others = ""  # who they are

    @property
    def others(self) -> list[str]:
        """Return the names of the nodes that publish on the topic but are not to."""
        return [_name(endpoint) for endpoint in self._split()[1]]

    def require(self, number: int) -> None:
        """Take a message of this number, which is not the one due or may be another's; else raise.

        Raises MessageError if it is another's, and GraphError if it cannot be told whose it is.
        """
        if number in self._others_due:
            if number == self.due:
                text = f"cannot be told apart any more from those of node {self._others}, which publishes too"
                raise GraphError(f"the messages on {self._topic} {text}; end that node and run again")
            self._others_due.remove(number)
            self._refuse(number)
        if number == self.due:
            return
        own, others = self._split()
        if others:
            self._others = ", ".join(repr(_name(endpoint)) for endpoint in others)
            self._refuse(number)
        named = [endpoint for endpoint in own if endpoint.node_name != _NAMELESS]
        known, self._own = self._own, tuple(named[0].endpoint_gid) if named else self._own
        if number < self.due and known == self._own:
            self._others = "that is gone again"
            self._refuse(number)

    @property
    def contested(self) -> bool:
        """Tell whether somebody else has published on the topic: then every message is to be looked at."""
        return bool(self._others_due)

    def _refuse(self, number: int) -> None:
        """Follow the numbers of another publisher; raises MessageError."""
        self._others_due.add(number + 1)
        raise MessageError(Reason.SENDER, f"node {self._others} publishes too, whose messages do not count")

    def _split(self) -> tuple[list[TopicEndpointInfo], list[TopicEndpointInfo]]:
        """Return the publisher that counts, if it is there, and all others."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        own = [endpoint for endpoint in there if tuple(endpoint.endpoint_gid) == self._own]
        own = own or [endpoint for endpoint in there if endpoint.node_name in self._peers]
        own = own or [endpoint for endpoint in there if endpoint.node_name == _NAMELESS]
        return own[:1], [endpoint for endpoint in there if endpoint not in own[:1]]


def _name(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of the node that an endpoint belongs to."""
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
