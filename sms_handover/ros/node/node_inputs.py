"""Inputs of a node: what its loop works on, and news of the run, both through the message filter."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any, TypeVar

from rclpy.node import Node

from sms_handover.ros.codecs.loop_messages import decoded
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.node.message_filter import Decode, MessageFilter, OnMessage
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.inputs import ExecutorInputs, Inputs
from sms_handover.simulation.parameters import DIRECT, EXECUTOR

T = TypeVar("T")

INPUTS: dict[str, Callable[[Node], Inputs]] = {DIRECT: DirectInputs, EXECUTOR: ExecutorInputs}

_NEWS_PERIOD_S = 0.02  # [s] of wall time between two polls for news of the run


class NodeInputs:
    """Subscribes for ``loop``, which is open while the node is active, or for ``news``, which always are."""

    def __init__(self, node: Node, transport: str, awaited: Callable[[], str]) -> None:
        """Begin closed; ``awaited`` returns the input that the loop waits for, "" if it has none."""
        self.loop, self.news = (INPUTS[transport](node) for _ in range(2))
        self.loop.awaited = awaited
        self.loop.close(drop=False)
        self._company: tuple[NodeInputs, ...] = (self,)
        self._news_at = 0.0

    def connect(self, endpoints: Endpoints, message_filter: MessageFilter) -> None:
        """Subscribe with these endpoints and this filter from now on."""
        self._endpoints, self._filter = endpoints, message_filter

    def subscribe(self, name: str, on_message: OnMessage[T], decode: Decode[T]) -> None:
        """Hand to ``on_message`` what ``decode`` returns of the good messages of a topic's own publisher."""
        self._subscribe(self.loop, name, on_message, decode)

    def subscribe_to_all(self, name: str, on_message: OnMessage[T], decode: Decode[T]) -> None:
        """Hand to ``on_message`` the good messages of a topic, whoever publishes it."""
        filtered = self._filter.wrap(name, on_message, decode)
        self._endpoints.subscribe_serialized(name, self.loop, filtered)

    def subscribe_news(self, name: str, kind: Any, on_news: Callable[[Any], None]) -> None:
        """Hand to ``on_news`` the good messages of a topic that comes seldom and counts in every state."""
        self._subscribe(
            self.news, name, lambda message, sent_ns: on_news(message), lambda data: decoded(data, kind)
        )

    def _subscribe(self, inputs: Inputs, name: str, on_message: OnMessage[T], decode: Decode[T]) -> None:
        identity = self._endpoints.identity(name)
        filtered = self._filter.wrap(name, on_message, decode, identity)
        self._endpoints.subscribe_serialized(name, inputs, filtered)

    def poll_news(self) -> None:
        """Take the news that have come, for the nodes of the same process too, now and then."""
        now = monotonic()
        if now >= self._news_at:
            self._news_at = now + _NEWS_PERIOD_S
            for inputs in self._company:
                inputs.news.poll()

    def accompany(self, others: Sequence["NodeInputs"]) -> None:
        """Serve the inputs of other nodes of the same process too."""
        self._company = (self, *others)
        self.loop.accompany([other.loop for other in others])

    def destroy(self) -> None:
        """Give everything back to the middleware."""
        self.news.destroy()
        self.loop.destroy()
