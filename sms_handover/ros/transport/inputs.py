"""Inputs of a node's loop, as messages, requests and responses: the interface, and the way public in rclpy.

A node gets the messages, requests and responses of its loop by an :class:`Inputs`, everything else by
rclpy as usual. There are two, chosen by the parameter ``transport``: this file's leaves all to an
executor; :mod:`sms_handover.ros.transport.direct` takes them from the middleware itself. Both hand over
the same bytes in the same order of each topic; `make bench` measures what each costs.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import time_ns
from typing import Any

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from sms_handover.ros.transport.spinning import AdaptiveSpin

# CDR bytes; wall time in ns at which they were sent, else received; global identifier of their publisher,
# b"" if not known
OnSerialized = Callable[[bytes, int, bytes], None]
OnRequest = Callable[[Any], Any]  # request to response


@dataclass(frozen=True)
class Client:
    """Calls one service without waiting; the responses go to the callback that it was created with."""

    service_is_ready: Callable[[], bool]
    call: Callable[[Any], object]


class Inputs(ABC):
    """The messages, requests and responses that the loop of one node waits for.

    ``wakes`` counts how often something awaited has ended a sleep: a loop that is woken more than once
    per tick loses time. ``awaited`` names the topic or service without which the loop cannot go on, "" if
    there is none; the node sets it. ``identifies`` is whether the publisher of a message is known.
    ``spin`` looks for what is awaited before the loop sleeps, None if it does not.
    """

    wakes: int = 0
    awaited: Callable[[], str] = staticmethod(lambda: "")
    identifies: bool = False
    closed: bool = False
    spin: AdaptiveSpin | None = None
    drops: bool = False

    def close(self, *, drop: bool) -> None:
        """Hand over no message or response until opened; messages wait, or with ``drop`` are lost.

        Requests are answered all the same.
        """
        self.closed, self.drops = True, drop

    def open(self) -> None:
        """Hand over what has waited, and again what comes."""
        self.poll()
        self.closed = False

    @abstractmethod
    def subscribe(self, kind: Any, topic: str, profile: QoSProfile, on_data: OnSerialized) -> Subscription:
        """Hand every message of a topic to ``on_data``."""

    @abstractmethod
    def create_client(self, kind: Any, service: str, on_response: Callable[[Any], None]) -> Client:
        """Return a client, and hand every response to ``on_response``."""

    @abstractmethod
    def create_service(self, kind: Any, service: str, on_request: OnRequest) -> None:
        """Offer a service."""

    @abstractmethod
    def destroy(self) -> None:
        """Give back to the middleware what the node does not know of, and forget what waits."""

    def accompany(self, others: Sequence["Inputs"]) -> None:  # noqa: B027  an executor serves every node
        """Serve those of other nodes of the same process and thread too, in this order."""

    @abstractmethod
    def poll(self) -> int:
        """Hand over everything that has come and that no executor will, and return how many there were."""

    @abstractmethod
    def spin_once(self, executor: Executor, timeout_s: float) -> None:
        """Handle what has come, of the loop and of the executor; sleep at most ``timeout_s`` if nothing has.

        The arrival of what is ``awaited`` ends the sleep, while that of others need not.
        """

    @abstractmethod
    def spin_some(self, executor: Executor) -> None:
        """Handle what has come for the loop, without a sleep: for a loop that keeps the processor."""

    @abstractmethod
    def give_turn(self, executor: Executor) -> None:
        """Let the executor handle one thing if it has had no turn for long, while there is time for it."""


class ExecutorInputs(Inputs):
    """Leaves everything to the executor that spins the node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._waiting: list[Callable[[], object]] = []

    def open(self) -> None:
        """Hand over what has waited, and again what comes."""
        super().open()
        waiting, self._waiting = self._waiting, []
        for deliver in waiting:
            deliver()

    def _hand_over(self, deliver: Callable[[], object]) -> None:
        """Deliver a message or response now, or when the inputs are open."""
        if self.closed:
            self._waiting.append(deliver)
        else:
            deliver()

    def destroy(self) -> None:
        """Forget what waits; the entities are destroyed with the node or when it is cleaned up."""
        self._waiting.clear()

    def subscribe(self, kind: Any, topic: str, profile: QoSProfile, on_data: OnSerialized) -> Subscription:
        """Hand every message of a topic to ``on_data``."""

        def callback(data: bytes) -> None:
            now_ns = time_ns()  # EventsExecutor fails on callbacks that ask for the time of sending
            if not (self.closed and self.drops):
                self._hand_over(lambda: on_data(data, now_ns, b""))

        return self._node.create_subscription(kind, topic, callback, profile, raw=True)

    def create_client(self, kind: Any, service: str, on_response: Callable[[Any], None]) -> Client:
        """Return a client, and hand every response to ``on_response``."""
        client = self._node.create_client(kind, service)

        def call(request: Any) -> None:
            future = client.call_async(request)
            future.add_done_callback(lambda done: self._hand_over(lambda: on_response(done.result())))

        return Client(client.service_is_ready, call)

    def create_service(self, kind: Any, service: str, on_request: OnRequest) -> None:
        """Offer a service."""
        self._node.create_service(kind, service, lambda request, empty: on_request(request))

    def poll(self) -> int:
        """Return 0: the executor hands over everything."""
        return 0

    def spin_once(self, executor: Executor, timeout_s: float) -> None:
        """Let the executor handle what comes."""
        executor.spin_once(timeout_sec=timeout_s)

    def spin_some(self, executor: Executor) -> None:
        """Let the executor handle what has come."""
        executor.spin_once(timeout_sec=0.0)

    def give_turn(self, executor: Executor) -> None:
        """Do nothing: whatever comes is handled by the executor."""
