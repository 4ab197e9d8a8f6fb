"""The whole graph in one process: the real nodes, and an ear in the place of the recorder."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from sms_handover_interfaces.msg import RunState
from std_msgs.msg import Header, String

from sms_handover.graph.topics import (
    CONTROLLER,
    IK,
    JOINT_STATES,
    PLANT,
    RECORDER,
    RUN_READY,
    RUN_RECORDED,
    RUN_STATE,
    TRAJECTORY,
    Rate,
    Topic,
    graph_topics,
)
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns
from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.simulation.parameters import EXECUTOR

from .bench import Bench, Parameters
from .short_handover import short_handover

ARMS = ("arm_a", "arm_b")
TOPICS = graph_topics(ARMS)
_LATE_NS = 3_000_000_000  # ns, after the end of every run that is tested
_TICK_NS = 1_000_000  # ns
_RUN_STATE = "sms_handover_interfaces/msg/RunState"
_NEVER_S = 3600.0  # s of wall time: a node that is slow on a busy machine is asked once
REAL: Mapping[str, Callable[[], GraphNode[Any]]] = {
    PLANT: PlantNode,
    TRAJECTORY: TrajectoryNode,
    IK: IkNode,
    CONTROLLER: ControllerNode,
}


class Ear:
    """A node in the place of the recorder: it keeps the bytes of every message, by topic."""

    def __init__(self, node: Node, peers: Sequence[str]) -> None:
        """Listen to every topic of the graph."""
        self.heard: dict[str, list[bytes]] = {topic.name: [] for topic in TOPICS}
        self._endpoints = Endpoints(node, TOPICS, peers)
        self._ready = self._endpoints.publisher(RUN_READY)
        self._recorded = self._endpoints.publisher(RUN_RECORDED)
        self.recorded_ns: int | None = None  # how far a recorder that does not keep up has come
        self.types = MessageTypes()
        for topic in TOPICS:
            self._endpoints.subscribe(topic.name, partial(self._hear, topic.name), raw=True)

    def _hear(self, topic: str, data: bytes) -> None:
        """Keep a message, and tell the plant that it need not wait."""
        self.heard[topic].append(data)
        if topic == RUN_STATE and self.types.deserialize(data, _RUN_STATE).state == RunState.WAITING:
            self._ready.publish(String(data=RECORDER))
        if topic == JOINT_STATES and len(data) == len(self.heard[topic][0]):
            time_ns = stamp_ns(data)
            if not 0 <= time_ns < _LATE_NS or time_ns % _TICK_NS:
                return  # it is bad on purpose, as those of another length
            self.tell_recorded(time_ns if self.recorded_ns is None else min(time_ns, self.recorded_ns))

    def tell_recorded(self, time_ns: int) -> None:
        """Tell up to which stamp everything is in the bag."""
        self._recorded.publish(Header(stamp=time_message(time_ns)))

    def tell_raw(self, data: bytes) -> None:
        """Tell something else, as CDR bytes."""
        self._recorded.publish(data)

    def get_ready(self, bench: Bench) -> None:
        """Wait for the other nodes, and say so."""
        bench.until(lambda: not self._endpoints.unmatched, "the endpoints of the graph")
        self._ready.publish(String(data=RECORDER))


class Graph:
    """Some of the nodes in one process with an ear, ready to run."""

    def __init__(
        self,
        bench: Bench,
        parameters: Parameters | None = None,
        *,
        schedule: str | None = None,
        fakes: Mapping[str, Callable[[Node, Sequence[str]], Any]] | None = None,
        names: Sequence[str] = tuple(REAL),
    ) -> None:
        """Start the nodes of these names; ``fakes`` puts something on a plain node in place of a real one."""
        path = bench.folder / "schedule.yaml"
        path.write_text(short_handover() if schedule is None else schedule, encoding="utf-8")
        self.peers = (*names, RECORDER)
        parameters = dict(parameters or {})
        parameters["common"] = {
            "peers": self.peers,
            "scenario": "colliding",  # step targets
            "schedule": str(path),
            "transport": EXECUTOR,  # every node has its turn, and a test can act while the graph runs
            **parameters.get("common", {}),
        }
        parameters[PLANT] = {"resend_after": _NEVER_S, **parameters.get(PLANT, {})}
        self.bench = bench
        bench.start(parameters)
        self.ear = Ear(bench.plain(RECORDER), self.peers)
        self.fakes = {name: make(bench.plain(name), self.peers) for name, make in (fakes or {}).items()}
        self.nodes = {name: bench.add(REAL[name]) for name in names if name not in self.fakes}
        self.client = bench.plain("client")

    @property
    def heard(self) -> dict[str, list[bytes]]:
        """Return the bytes of the messages so far, by topic."""
        return self.ear.heard

    @property
    def plant(self) -> PlantNode:
        """Return the plant."""
        plant = self.nodes[PLANT]
        assert isinstance(plant, PlantNode)
        return plant

    def run(self) -> None:
        """Run to the end, and until the ear has all of it."""
        self.ear.get_ready(self.bench)
        self.wait_for_end()

    def wait_for_end(self) -> None:
        """Wait for the end of the run and for what is still on the way."""
        self.bench.until(lambda: self.plant.finished, "the end of the run")
        self.bench.until(self.everything_heard, "all messages")

    def everything_heard(self) -> bool:
        """Whether the ear has as many messages as the nodes have published."""
        published: dict[str, int] = {}
        for node in self.nodes.values():
            for name, count in node.endpoints.counts.items():
                published[name.lstrip("/")] = published.get(name.lstrip("/"), 0) + count
        heard = {name.lstrip("/"): len(messages) for name, messages in self.heard.items()}
        if not all(heard[name] >= count for name, count in published.items()):
            return False
        each_once = (topic for topic in TOPICS if len(topic.publishers) == 1)
        of_this_run = (topic for topic in each_once if topic.rate in (Rate.TICK, Rate.REFERENCE))
        return self.plant.runs < 2 or all(  # in a second run what was heard of the first is left aside
            self._heard_since_zero(topic.name) >= published.get(topic.name, 0) for topic in of_this_run
        )

    def _heard_since_zero(self, topic: str) -> int:
        """Return how many messages have come on a topic since time last began at zero."""
        messages = reversed(self.heard[topic])
        return next((count for count, data in enumerate(messages, 1) if data[4:12] == bytes(8)), 0)

    def call(self, service: str, kind: Any, **values: Any) -> Any:
        """Return the answer of a service of the plant."""
        client = self.client.create_client(kind, f"{PLANT}/{service}")
        self.bench.until(client.service_is_ready, f"the service {service}")
        answer = self.bench.result(client.call_async(kind.Request(**values)), f"the answer of {service}")
        self.client.destroy_client(client)
        return answer

    def stamps(self, topic: str) -> list[int]:
        """Return the stamps heard on a topic, in ns."""
        kind = next(item.type for item in TOPICS if item.name == topic)
        place = self.ear.types.stamp_place(kind)
        assert place is not None
        return [stamp_ns(data, place) for data in self.heard[topic]]


class Messages:
    """Decodes what an ear has heard."""

    def __init__(self) -> None:
        """Know the types of the graph."""
        self._types = MessageTypes()
        self._topics: dict[str, Topic] = {topic.name: topic for topic in TOPICS}

    def of(self, graph: Graph, topic: str) -> list[Any]:
        """Return the messages heard on a topic."""
        kind = self._topics[topic].type
        return [self._types.deserialize(data, kind) for data in graph.heard[topic]]

    def last_run(self, graph: Graph, topic: str) -> list[bytes]:
        """Return what was heard on a topic since time last began at zero, its padding made zero."""
        messages, kind = graph.heard[topic], self._topics[topic].type
        starts = [index for index, data in enumerate(messages) if stamp_ns(data) == 0]
        begin = starts[-1] if starts else 0
        return [self._types.serialize(self._types.deserialize(data, kind)) for data in messages[begin:]]
