"""Subscriptions that are emptied in batches instead of waking Python for every message.

An executor hands over each message by itself, which costs a reader of the 1 kHz loop a switch of
threads per message. A tap leaves messages in the middleware's queue until it is asked, and takes all
there are. It uses two names that rclpy keeps for its own executors (the list of a node's
subscriptions and ``take_message``), which is why they stand in this file only.
"""

from collections.abc import Callable
from time import time_ns
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription

Receive = Callable[[bytes, int], None]

_SENT = "source_timestamp"  # [ns] of wall time, when the message was published


class Taps:
    """The raw subscriptions of one node that are emptied on demand."""

    def __init__(self, node: Node) -> None:
        """Begin without any; the node must not have been given to an executor yet."""
        self._node = node
        self._taps: list[tuple[Subscription, Receive]] = []

    def take_over(self, subscription: Subscription, receive: Receive) -> None:
        """Hide a raw subscription from executors; ``receive`` gets its messages and when they were sent."""
        self._node._subscriptions.remove(subscription)
        self._taps.append((subscription, receive))

    def empty(self) -> int:
        """Take every message that has arrived, topic by topic, and return how many there were."""
        taken = 0
        for subscription, receive in self._taps:
            while True:
                message: Any = subscription.handle.take_message(subscription.msg_type, True)
                if message is None:
                    break
                data, info = message
                receive(data, info.get(_SENT) or time_ns())
                taken += 1
        return taken

    def destroy(self) -> None:
        """Give the subscriptions back to the middleware."""
        for subscription, _ in self._taps:
            subscription.destroy()
        self._taps.clear()
