"""How what a node's loop waits for reaches it: the interface, and the way that is public in rclpy.

A node gets the messages, requests and answers of its loop by an :class:`Inputs`, everything else by
rclpy as usual. There are two, chosen by the parameter ``transport``: this file's leaves all to an
executor; :mod:`sms_handover.ros.transport.direct` takes them from the middleware itself. Both hand over
the same bytes in the same order of each topic; `make bench` measures what each costs.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from time import time_ns
from typing import Any

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

# CDR bytes; wall time in ns of their sending, else of their coming; global identifier of their publisher,
# b"" if not known
Deliver = Callable[[bytes, int, bytes], None]
Answer = Callable[[Any], Any]  # request to response


class Asker(ABC):
    """Asks one service; the answers go to where its maker said."""

    @abstractmethod
    def ready(self) -> bool:
        """Whether the service is there."""

    @abstractmethod
    def ask(self, request: Any) -> None:
        """Send a request and return at once."""


class Inputs(ABC):
    """The messages, requests and answers that the loop of one node waits for.

    ``wakes`` counts how often something awaited has ended a sleep: a loop that is woken more than once
    per tick loses time. ``awaited`` names the topic or service without which the loop cannot go on, "" if
    there is none; the node sets it. ``identifies`` tells whether it is known who a message is from.
    """

    wakes: int = 0
    awaited: Callable[[], str] = staticmethod(lambda: "")
    identifies: bool = False
    closed: bool = False
    drops: bool = False

    def close(self, *, drop: bool) -> None:
        """Hand over no message or answer until opened; messages wait, or with ``drop`` are lost.

        Requests are answered all the same.
        """
        self.closed, self.drops = True, drop

    def open(self) -> None:
        """Hand over what has waited, and again what comes."""
        self.poll()
        self.closed = False

    @abstractmethod
    def subscribe(self, kind: Any, topic: str, profile: QoSProfile, deliver: Deliver) -> Subscription:
        """Hand every message of a topic to ``deliver``."""

    @abstractmethod
    def asker(self, kind: Any, service: str, receive: Callable[[Any], None]) -> Asker:
        """Return what asks a service, and hand every answer to ``receive``."""

    @abstractmethod
    def serve(self, kind: Any, service: str, answer: Answer) -> None:
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
    def look(self, executor: Executor) -> None:
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
        for hand_over in waiting:
            hand_over()

    def destroy(self) -> None:
        """Forget what waits; the entities are destroyed with the node or when it is cleaned up."""
        self._waiting.clear()

    def subscribe(self, kind: Any, topic: str, profile: QoSProfile, deliver: Deliver) -> Subscription:
        """Hand every message of a topic to ``deliver``."""

        def callback(data: bytes) -> None:
            now_ns = time_ns()  # EventsExecutor fails on callbacks that ask for the time of sending
            if not self.closed:
                deliver(data, now_ns, b"")
            elif not self.drops:
                self._waiting.append(lambda: deliver(data, now_ns, b""))

        return self._node.create_subscription(kind, topic, callback, profile, raw=True)

    def asker(self, kind: Any, service: str, receive: Callable[[Any], None]) -> Asker:
        """Return what asks a service, and hand every answer to ``receive``."""

        def callback(answer: Any) -> None:
            if self.closed:
                self._waiting.append(lambda: receive(answer))
            else:
                receive(answer)

        return _ExecutorAsker(self._node, kind, service, callback)

    def serve(self, kind: Any, service: str, answer: Answer) -> None:
        """Offer a service."""
        self._node.create_service(kind, service, lambda request, empty: answer(request))

    def poll(self) -> int:
        """Return 0: the executor hands over everything."""
        return 0

    def spin_once(self, executor: Executor, timeout_s: float) -> None:
        """Let the executor handle what comes."""
        executor.spin_once(timeout_sec=timeout_s)

    def look(self, executor: Executor) -> None:
        """Let the executor handle what has come."""
        executor.spin_once(timeout_sec=0.0)

    def give_turn(self, executor: Executor) -> None:
        """Do nothing: whatever comes is handled by the executor."""


class _ExecutorAsker(Asker):
    """Asks a service by rclpy's futures."""

    def __init__(self, node: Node, kind: Any, service: str, receive: Callable[[Any], None]) -> None:
        self._client = node.create_client(kind, service)
        self._receive = receive

    def ready(self) -> bool:
        """Whether the service is there."""
        return bool(self._client.service_is_ready())

    def ask(self, request: Any) -> None:
        """Send a request and return at once."""
        self._client.call_async(request).add_done_callback(lambda done: self._receive(done.result()))
