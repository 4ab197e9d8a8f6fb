"""The monitor of a running graph: how far it is, what was grasped, what it waits for."""

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from sms_handover_interfaces.msg import PublishedCounts, RunState, TaskPhase
from std_srvs.srv import Trigger

from sms_handover.errors import MessageError
from sms_handover.graph.events import RunEvent
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    GRASP_EVENT,
    PLANT,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_STATE,
    TASK_PHASE,
    graph_topics,
    target_pose,
    tool_pose,
)
from sms_handover.messages.values import header_ns, task_phase
from sms_handover.ros.codecs.events import read_grasp_event, read_run_event
from sms_handover.ros.codecs.loop_messages import decoded
from sms_handover.ros.message_types import message_class
from sms_handover.ros.node.diagnostics import node_of
from sms_handover.ros.node.message_filter import Decode
from sms_handover.ros.qos import LATCHED
from sms_handover.ros.transport.inputs import Inputs
from sms_handover.ros.transport.publisher_identity import PublisherIdentity
from sms_handover.types import GraspEvent

_EVERY_NODE = 16  # [messages] of depth, so that the latest of one node does not push out those of others

T = TypeVar("T")
E = TypeVar("E", GraspEvent, RunEvent)


@dataclass
class Progress:
    """What is known of the run.

    ``tool_error`` [m] is the distance of each tool from its target; ``wall_time`` [s] is how long the run has
    taken by the latest message of the plant; ``task_end_ns`` is the present end of the task, 0 if unknown.
    """

    state: int = RunState.WAITING
    detail: str = ""
    stamp_ns: int = 0
    wall_time: float = 0.0
    phase: str = ""
    task_end_ns: int = 0
    task_failed: bool = False
    tool_error: dict[str, float] = field(default_factory=dict)
    events: list[GraspEvent] = field(default_factory=list)
    run_events: list[RunEvent] = field(default_factory=list)
    unseen: list[GraspEvent | RunEvent] = field(default_factory=list)  # a display takes them
    waiting: dict[str, str] = field(default_factory=dict)

    @property
    def failed(self) -> bool:
        """Whether the task has failed."""
        return bool(self.state == RunState.FAILED)


class RunMonitor:
    """Subscribes to a graph without taking part in it.

    ``inputs`` delivers everything when :meth:`poll` is called. Of what is published every reference period
    only the latest message counts: handling each one would take a processor from the loop. Messages that
    are invalid or from foreign publishers are left to the nodes to count.
    """

    def __init__(self, node: Node, arms: tuple[str, ...], inputs: Inputs) -> None:
        self.progress = Progress()
        self._inputs = inputs
        self._node = node
        self._targets: dict[str, PoseStamped] = {}
        self._published: dict[str, dict[str, int]] = {}
        self._finish = node.create_client(Trigger, f"{PLANT}/finish")
        self._topics = {topic.name: topic for topic in graph_topics(arms)}
        self._subscribe(RUN_STATE, _reader(RunState), self._on_state)
        self._subscribe(GRASP_EVENT, read_grasp_event, partial(self._on_event, self.progress.events))
        self._subscribe(RUN_EVENTS, read_run_event, partial(self._on_event, self.progress.run_events))
        self._subscribe(RUN_PUBLISHED, _reader(PublishedCounts), self._on_counts)
        self._subscribe_latest(TaskPhase, TASK_PHASE, self._on_phase)
        self._subscribe_latest(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, depth=_EVERY_NODE)
        for arm in arms:
            self._subscribe_latest(PoseStamped, target_pose(arm), partial(self._on_target, arm))
            self._subscribe_latest(PoseStamped, tool_pose(arm), partial(self._on_tool, arm))

    def poll(self) -> None:
        """Handle what has arrived."""
        self._inputs.poll()

    def _subscribe(self, name: str, read: Decode[T], on_message: Callable[[T], None]) -> None:
        """Pass every valid message of the graph's own publishers of a topic to ``on_message``."""
        topic, full_name = self._topics[name], self._node.resolve_topic_name(name)
        several = len(topic.publishers) > 1
        identity = PublisherIdentity(self._node, full_name, topic.publishers, several=several)

        def receive(data: bytes, sent_ns: int, publisher: bytes) -> None:
            with suppress(MessageError):
                if publisher not in identity.own:
                    identity.require(publisher)
                on_message(read(data))

        self._inputs.subscribe(message_class(topic.type), name, LATCHED, receive)

    def _subscribe_latest(
        self, kind: Any, topic: str, on_message: Callable[[Any], None], *, depth: int = 1
    ) -> None:
        """Pass the latest messages of a topic to ``on_message``."""
        profile = QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST, depth=depth, reliability=QoSReliabilityPolicy.BEST_EFFORT
        )  # a display must never hold the loop back

        def receive(data: bytes, sent_ns: int, publisher: bytes) -> None:
            with suppress(MessageError, KeyError):
                on_message(decoded(data, kind))

        self._inputs.subscribe(kind, topic, profile, receive)

    @property
    def finished(self) -> bool:
        """Whether the plant has said that the run is over."""
        return self.progress.state in (RunState.FINISHED, RunState.FAILED)

    @property
    def has_every_event(self) -> bool:
        """Whether every event has arrived that the nodes, at their end, report to have published.

        Only the plant must have reported; a node that hangs is not waited for.
        """
        return (
            PLANT in self._published
            and len(self.progress.events) >= self._published_count(GRASP_EVENT)
            and len(self.progress.run_events) >= self._published_count(RUN_EVENTS)
        )

    def present(self, names: Collection[str]) -> set[str]:
        """Return which of some nodes are in the graph.

        A node that leaves announces it twice: for itself, and for each of its publishers. On a bad network
        one of the two may be lost, and is noticed only after the lease of DDS.
        """
        publishers = {info.node_name for info in self._node.get_publishers_info_by_topic(RUN_PUBLISHED)}
        return publishers.intersection(names, self._node.get_node_names())

    def ask_to_finish(self) -> bool:
        """Ask the plant to end the run at the present tick; return whether it could be asked."""
        ready = bool(self._finish.service_is_ready())
        if ready:
            self._finish.call_async(Trigger.Request())
        return ready

    def waiting_for(self) -> str:
        """Return what the nodes report to wait for, in words."""
        waiting: Mapping[str, str] = self.progress.waiting
        return "; ".join(f"{name} is {text}" for name, text in waiting.items()) or "no node reports why"

    def _on_state(self, message: Any) -> None:
        if message.state == RunState.WAITING:  # after a run: its events are history
            self.progress.events.clear()
            self.progress.run_events.clear()
            self._published.clear()
        self.progress.state = message.state
        self.progress.detail = message.detail
        self.progress.wall_time = message.wall_time
        self.progress.stamp_ns = header_ns(message)

    def _on_event(self, events: list[E], event: E) -> None:
        events.append(event)
        self.progress.unseen.append(event)

    def _on_counts(self, message: Any) -> None:
        self._published[message.node] = dict(zip(message.topics, message.counts, strict=False))

    def _published_count(self, name: str) -> int:
        return sum(
            count
            for counts in self._published.values()
            for topic, count in counts.items()
            if topic.endswith(f"/{name}")
        )

    def _on_phase(self, message: Any) -> None:
        task = task_phase(message)
        self.progress.phase = task.name
        self.progress.task_end_ns, self.progress.task_failed = task.end_ns, task.failed
        self.progress.stamp_ns = max(self.progress.stamp_ns, header_ns(message))

    def _on_target(self, arm: str, message: Any) -> None:
        self._targets[arm] = message.pose.position

    def _on_tool(self, arm: str, message: Any) -> None:
        target = self._targets.get(arm)
        if target is not None:
            tool = message.pose.position
            away = np.array([tool.x - target.x, tool.y - target.y, tool.z - target.z])
            self.progress.tool_error[arm] = float(np.linalg.norm(away))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            node = node_of(status.name)
            if status.level == DiagnosticStatus.OK:
                self.progress.waiting.pop(node, None)
            else:
                self.progress.waiting[node] = status.message


def _reader(kind: Any) -> Decode[Any]:
    return lambda data: decoded(data, kind)
