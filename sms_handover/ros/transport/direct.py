"""Direct inputs: a node's loop takes them from the middleware itself, without an executor between.

An executor wakes Python for each message by itself. Here the node sleeps on the one message that it
cannot go on without, and then takes all there are. This file alone uses names that rclpy keeps for its
own executors: the lists of a node's entities, ``WaitSet``, ``take_response``, ``send_request``,
``service_take_request`` and ``service_send_response``. Where they change, the parameter ``transport``
offers the public way.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from time import monotonic, time_ns
from typing import Any

from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from sms_handover.ros.transport.inputs import Client, Inputs, OnRequest, OnSerialized
from sms_handover.ros.transport.rcl_take import IDENTIFIES, SerializedTaker
from sms_handover.units import NS_PER_S

_BATCH = 4096  # taken of one input at most before another has its turn
_SERVE_S = 0.02  # [s] of wall time at most between two turns of the executor while the loop runs
_HOT_S = 0.1  # [s] of wall time without anything for the loop after which the executor does the waiting
_IDLE_S = 0.005  # [s] of wall time between two polls for the loop then


class DirectInputs(Inputs):
    """Takes messages, requests and responses of one node; the node must not be with an executor yet."""

    identifies = IDENTIFIES

    def __init__(self, node: Node) -> None:
        self._node = node
        self._sources: dict[str, _Source] = {}
        self._company: tuple[DirectInputs, ...] = ()
        self._serve_at = self._hot_until = 0.0
        self._slept = False

    def subscribe(self, kind: Any, topic: str, profile: QoSProfile, on_data: OnSerialized) -> Subscription:
        """Hand every message of a topic to ``on_data``."""
        subscription = self._node.create_subscription(kind, topic, _never, profile, raw=True)
        self._node._subscriptions.remove(subscription)
        self._sources[topic] = _Messages(self._node, subscription, on_data)
        return subscription

    def create_client(self, kind: Any, service: str, on_response: Callable[[Any], None]) -> Client:
        """Return a client, and hand every response to ``on_response``."""
        client = self._node.create_client(kind, service)
        self._node._clients.remove(client)
        self._sources[service] = _Responses(self._node, client, on_response)
        return Client(client.service_is_ready, client.handle.send_request)

    def create_service(self, kind: Any, service: str, on_request: OnRequest) -> None:
        """Offer a service."""
        entity = self._node.create_service(kind, service, _never)
        self._node._services.remove(entity)
        self._sources[service] = _Requests(self._node, entity, on_request)

    def accompany(self, others: Sequence[Inputs]) -> None:
        """Serve those of other nodes of the same process and thread too, in this order."""
        company = tuple(other for other in others if isinstance(other, DirectInputs))
        self._company = (*company[:1], self, *company[1:])

    def poll(self) -> int:
        """Hand over everything that has come, in the order in which the inputs were made.

        Other nodes have their turn when nothing has come, so that what is not urgent does not hold up
        what is: the plant and the controller answer each other before a reference is worked out.
        """
        if self.closed:
            found = sum([source.take_closed(drop=self.drops) for source in self._sources.values()])
        else:
            found = sum([source.take_all() for source in self._sources.values()])
        for other in self._company:
            found = found or (other is not self and other.poll())
        return found

    def spin_once(self, executor: Executor, timeout_s: float) -> None:
        """Handle what has come; else sleep until what is awaited comes, with turns of the executor."""
        found, now = self.poll(), monotonic()
        if found:
            until = min(self._serve_at, now + timeout_s)
            while self._company and found and now < until:  # nodes of one process that answer each other
                found, now = self._answer_each_other() or self.poll(), monotonic()
            self._hot_until = now + _HOT_S
            self.wakes += self._slept
            self._slept = False
        elif self.closed or now > self._hot_until or (awaited := self._sources.get(self.awaited())) is None:
            executor.spin_once(timeout_sec=min(timeout_s, _IDLE_S))
            return
        else:
            self._slept = not self._take_first(awaited, now + min(timeout_s, _SERVE_S))
        self.give_turn(executor)

    def spin_some(self, executor: Executor) -> None:
        """Handle what has come for the loop; the executor has its turns elsewhere."""
        self.poll()

    def give_turn(self, executor: Executor) -> None:
        """Let the executor handle one thing if it has had no turn for long."""
        now = monotonic()
        if now >= self._serve_at:
            self._serve_at = now + _SERVE_S
            executor.spin_once(timeout_sec=0.0)

    def _take_first(self, awaited: "_Source", until: float) -> bool:
        """Wait for what is awaited and hand it over before anything else; return whether any of it has come.

        What the node publishes then is what another process waits for. A loop that spins goes on like this
        until a moment of monotonic time; another looks after its other inputs first.
        """
        came = False
        spin = None if self._company else self.spin  # nodes of one process would wait for themselves
        while True:
            if spin is None or not spin.find(awaited.take_one):
                self._sleep(awaited, max(until - monotonic(), 0.0))
                if not awaited.take_one():
                    return came
            came = True
            self.wakes += 1
            while self._take_awaited() and monotonic() < until:
                pass
            now = monotonic()
            self._hot_until = now + _HOT_S
            following = self._sources.get(self.awaited())
            if spin is None or self.closed or following is None or now >= until:
                return came
            awaited = following

    def _sleep(self, awaited: "_Source", timeout_s: float) -> None:
        """Sleep until what is awaited comes, or what another node of this process awaits."""
        others = [other for other in self._company if other is not self and not other.closed]
        theirs = [source for other in others if (source := other._sources.get(other.awaited()))]
        awaited.wait(timeout_s, theirs)

    def _answer_each_other(self) -> bool:
        """Hand over one message that a node cannot go on without; return whether there was one.

        Among nodes of one process it is there as soon as the other has published it, so this is nearly
        always enough; to poll the others each time would take longer than to publish them. Who
        answers this node is asked first: once it has answered there is something for this node.
        """
        for inputs in self._company:  # noqa: SIM110  any() with a generator takes longer
            if inputs._take_awaited():
                return True
        return False

    def _take_awaited(self) -> bool:
        """Hand over the next message that is awaited; return whether there was one."""
        source = None if self.closed else self._sources.get(self.awaited())
        return source is not None and source.take_one()

    def destroy(self) -> None:
        """Give everything back to the middleware."""
        for source in self._sources.values():
            source.destroy()
        self._sources.clear()


class _Source(ABC):
    """One kind of input: it can be slept on and emptied."""

    _counts = (1, 0, 0)  # of subscriptions, clients and services

    def __init__(self, node: Node, entity: Any) -> None:
        """Take an entity that the node no longer knows."""
        self._node, self._entity = node, entity
        self._wait_set: Any = None
        self._room: tuple[int, ...] = ()  # what the wait set has been made for

    @abstractmethod
    def _add_to(self, wait_set: Any) -> None:
        """Let a wait set wait for this too."""

    @abstractmethod
    def take_one(self) -> bool:
        """Hand over the next of what has come; return whether there was one."""

    def take_all(self) -> int:
        """Hand over what has come, ``_BATCH`` at most, and return how many there were."""
        for taken in range(_BATCH):
            if not self.take_one():
                return taken
        return _BATCH

    def take_closed(self, *, drop: bool) -> int:
        """Do what is due while the inputs are closed, and return how many there were: by default, nothing."""
        return 0

    def wait(self, timeout_s: float, others: Sequence["_Source"] = ()) -> None:
        """Sleep until something comes, or something of ``others``."""
        sources = (self, *others)
        counts = tuple(map(sum, zip(*(source._counts for source in sources), strict=True)))
        if counts != self._room:
            self._room, (subscriptions, clients, services) = counts, counts
            self._wait_set = rclpy_implementation.WaitSet(
                subscriptions, 0, 0, clients, services, 0, self._node.context.handle
            )
        self._wait_set.clear_entities()
        for source in sources:
            source._add_to(self._wait_set)
        self._wait_set.wait(int(timeout_s * NS_PER_S))

    def destroy(self) -> None:
        """Give the entity back to the middleware."""
        self._entity.destroy()


class _Messages(_Source):
    """The messages of a topic."""

    def _add_to(self, wait_set: Any) -> None:
        wait_set.add_subscription(self._entity.handle)

    def __init__(self, node: Node, subscription: Subscription, on_data: OnSerialized) -> None:
        super().__init__(node, subscription)
        self._taker = SerializedTaker(subscription)
        self._take = self._taker.take
        self._on_data = on_data

    def take_one(self) -> bool:
        """Hand over the next message."""
        message = self._take()
        if message is None:
            return False
        data, sent_ns, publisher = message
        self._on_data(data, sent_ns or time_ns(), publisher)
        return True

    def take_closed(self, *, drop: bool) -> int:
        """Lose what has come, if that is wanted."""
        if drop:
            on_data, self._on_data = self._on_data, _never
            self.take_all()
            self._on_data = on_data
        return 0

    def destroy(self) -> None:
        """Give everything back to the middleware."""
        self._taker.close()
        super().destroy()


class _Responses(_Source):
    """The responses of a service."""

    _counts = (0, 1, 0)

    def _add_to(self, wait_set: Any) -> None:
        wait_set.add_client(self._entity.handle)

    def __init__(self, node: Node, client: Any, on_response: Callable[[Any], None]) -> None:
        super().__init__(node, client)
        self._response = client.srv_type.Response
        self._on_response = on_response

    def take_one(self) -> bool:
        """Hand over the next response."""
        header, response = self._entity.handle.take_response(self._response)
        if header is None:
            return False
        self._on_response(response)
        return True


class _Requests(_Source):
    """The requests of a service."""

    _counts = (0, 0, 1)

    def _add_to(self, wait_set: Any) -> None:
        wait_set.add_service(self._entity.handle)

    def __init__(self, node: Node, service: Any, on_request: OnRequest) -> None:
        super().__init__(node, service)
        self._kind = service.srv_type
        self._on_request = on_request

    def take_one(self) -> bool:
        """Answer the next request."""
        request, header = self._entity.handle.service_take_request(self._kind.Request)
        if header is None:
            return False
        self._entity.send_response(self._on_request(request), header)
        return True

    def take_closed(self, *, drop: bool) -> int:
        """Answer all the same."""
        return self.take_all()


def _never(*arguments: object) -> None:
    """Stand in for a callback that no executor ever calls."""
