"""The launcher's ear on a running graph: how far it is, what was grasped, what it waits for."""

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
from sms_handover.ros.node.message_filter import Decode
from sms_handover.ros.qos import LATCHED
from sms_handover.ros.transport.inputs import Inputs
from sms_handover.ros.transport.publisher_identity import PublisherIdentity
from sms_handover.types import GraspEvent

_EVERY_NODE = 16  # [messages] of which the newest may not push out those of other nodes


T = TypeVar("T")


@dataclass
class Progress:
    """What is known of the run.

    ``tool_error`` is the distance in m of each tool to its target; ``wall_time`` is how long in s the
    plant says that the run has taken, with the last news of its state; ``task_end_ns`` is when the task
    ends as things are, 0 before that is known.
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
    waiting: dict[str, str] = field(default_factory=dict)


class RunMonitor:
    """Listens to a graph without taking part in it.

    Everything is taken by ``inputs`` when :meth:`look` is called. What comes every reference period is
    for show, so of that only the newest: a display that handled each message would keep a processor
    from the loop. What is bad, or from strangers, is left to the nodes to count.
    """

    def __init__(self, node: Node, arms: tuple[str, ...], inputs: Inputs) -> None:
        """Subscribe to what tells the progress of the run."""
        self.progress = Progress()
        self._inputs = inputs
        self._node = node
        self._targets: dict[str, PoseStamped] = {}
        self._published: dict[str, dict[str, int]] = {}
        self._finish = node.create_client(Trigger, f"{PLANT}/finish")
        self._topics = {topic.name: topic for topic in graph_topics(arms)}
        self._hear(RUN_STATE, _reader(RunState), self._on_state)
        self._hear(GRASP_EVENT, read_grasp_event, self.progress.events.append)
        self._hear(RUN_EVENTS, read_run_event, self.progress.run_events.append)
        self._hear(RUN_PUBLISHED, _reader(PublishedCounts), self._on_counts)
        self._show(TaskPhase, TASK_PHASE, self._on_phase)
        self._show(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, depth=_EVERY_NODE)
        for arm in arms:
            self._show(PoseStamped, target_pose(arm), partial(self._on_target, arm))
            self._show(PoseStamped, tool_pose(arm), partial(self._on_tool, arm))

    def look(self) -> None:
        """Take what has come."""
        self._inputs.poll()

    def _hear(self, name: str, read: Decode[T], take: Callable[[T], None]) -> None:
        """Hand every good message of the own publishers of a topic to ``take``."""
        topic, full_name = self._topics[name], self._node.resolve_topic_name(name)
        several = len(topic.publishers) > 1
        sender = PublisherIdentity(self._node, full_name, topic.publishers, several=several)

        def receive(data: bytes, sent_ns: int, publisher: bytes) -> None:
            with suppress(MessageError):
                if publisher not in sender.own:
                    sender.require(publisher)
                take(read(data))

        self._inputs.subscribe(message_class(topic.type), name, LATCHED, receive)

    def _show(self, kind: Any, topic: str, show: Callable[[Any], None], *, depth: int = 1) -> None:
        """Hand the newest messages of a topic to ``show``."""
        profile = QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST, depth=depth, reliability=QoSReliabilityPolicy.BEST_EFFORT
        )  # a display must never hold the loop back

        def receive(data: bytes, sent_ns: int, publisher: bytes) -> None:
            with suppress(MessageError, KeyError):
                show(decoded(data, kind))

        self._inputs.subscribe(kind, topic, profile, receive)

    @property
    def finished(self) -> bool:
        """Whether the plant has said that the run is over."""
        return self.progress.state in (RunState.FINISHED, RunState.FAILED)

    @property
    def heard_every_event(self) -> bool:
        """Whether every event has come that the nodes say, at their end, they have published.

        The plant must have said so; a node that hangs is not waited for.
        """
        return (
            PLANT in self._published
            and len(self.progress.events) >= self._told(GRASP_EVENT)
            and len(self.progress.run_events) >= self._told(RUN_EVENTS)
        )

    def present(self, names: Collection[str]) -> set[str]:
        """Return those of some nodes that are in the graph.

        A node that leaves says so twice: as a node, and for each of its publishers. On a bad network one
        of the two may be lost, and only after the lease of DDS is the other noticed.
        """
        publishers = {info.node_name for info in self._node.get_publishers_info_by_topic(RUN_PUBLISHED)}
        return publishers.intersection(names, self._node.get_node_names())

    def ask_to_finish(self) -> bool:
        """Ask the plant to end the run at the present tick; tell whether it could be asked."""
        ready = bool(self._finish.service_is_ready())
        if ready:
            self._finish.call_async(Trigger.Request())
        return ready

    def waiting_for(self) -> str:
        """Return in words what the nodes say they wait for."""
        waiting: Mapping[str, str] = self.progress.waiting
        return "; ".join(f"{name} is {text}" for name, text in waiting.items()) or "no node says why"

    def _on_state(self, message: Any) -> None:
        if message.state == RunState.WAITING:  # behind a run: what has come of it is history
            self.progress.events.clear()
            self.progress.run_events.clear()
            self._published.clear()
        self.progress.state = message.state
        self.progress.detail = message.detail
        self.progress.wall_time = message.wall_time
        self.progress.stamp_ns = header_ns(message)

    def _on_counts(self, message: Any) -> None:
        self._published[message.node] = dict(zip(message.topics, message.counts, strict=False))

    def _told(self, name: str) -> int:
        """Return how many messages of a topic the nodes say that they have published."""
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
            if status.level == DiagnosticStatus.OK:
                self.progress.waiting.pop(status.name, None)
            else:
                self.progress.waiting[status.name] = status.message


def _reader(kind: Any) -> Decode[Any]:
    """Return what reads messages of a class."""
    return lambda data: decoded(data, kind)
