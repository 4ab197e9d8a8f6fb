"""Recorder node: writes every message of the graph to a bag."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from time import monotonic, time_ns
from typing import Any

from rclpy.executors import Executor
from rclpy.qos import QoSProfile
from sms_handover_interfaces.msg import PublishedCounts
from std_msgs.msg import Header

from sms_handover.bag.ledger import ledger_table
from sms_handover.bag.parameters import RecorderParameters
from sms_handover.bag.provenance import provenance
from sms_handover.bag.recording import Recording
from sms_handover.bag.run_recordings import RunRecordings
from sms_handover.errors import BagError, ConfigurationError, MessageError, SmsHandoverError
from sms_handover.graph.topics import (
    CLOCK_PERIOD_NS,
    JOINT_STATES,
    PLANT,
    RECORDER,
    REFUSED_TOPIC,
    RUN_PUBLISHED,
    RUN_RECORDED,
    RUN_STATE,
    RUN_STATE_TYPE,
    Rate,
    Topic,
)
from sms_handover.nodes.parts.peer_parameters import PeerParameters
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.codecs.loop_messages import Stamped, decoded, stamped
from sms_handover.ros.message_types import message_class
from sms_handover.ros.node.diagnostics import NodeReport
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.node.message_filter import Decode, OnMessage
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK, EXIT_STOPPED, Stop, run_node
from sms_handover.ros.qos import profile_of, stored, weakest
from sms_handover.ros.transport.inputs import OnSerialized
from sms_handover.ros.transport.publisher_identity import PublisherIdentity
from sms_handover.simulation.parameters import LOCKSTEP
from sms_handover.simulation.scenario import scenario_text

_POLL_S = 0.005  # [s] of wall time between two batches: long enough to be cheap, short enough to lose little
_LOCKSTEP_POLL_S = 0.002  # [s] where the plant would run out of what it may be ahead, and wait
_REALTIME_NICENESS = 3  # [-] at most in real time, where nobody waits for a recorder that is behind
_QUIET_S = 0.05  # [s] of wall time without a message after which nothing is on the way any more
_DRAIN_S = 1.0  # [s] of wall time at most to wait for that
_FLUSH_NS = 15_000_000  # [ns] of simulation time after which what has come is written to the file
_DISCOVERY_PERIOD_S = 1.0  # [s] of wall time between two polls for topics beyond the graph


class RecorderNode(GraphNode[RecorderParameters]):
    """Writes every message of the graph, as it came, to a rosbag2 MCAP bag.

    It ends by itself when the run has ended and all that the other nodes have published has come.
    """

    def __init__(self) -> None:
        super().__init__(RECORDER, RecorderParameters)
        self._closed = True
        self._poll_s = _POLL_S
        self._described = self._run_is_over = False

    def prepare(self) -> None:
        """Create the bag; raises ConfigurationError if it cannot."""
        self._scenario_text = scenario_text(self.common, self.scenario)
        folder = self.parameters.folder or datetime.now().strftime("handover_%Y_%m_%d-%H_%M_%S")
        try:
            self._recordings = RunRecordings(Path(folder), self._describe, self.parameters.split)
        except BagError as error:
            raise ConfigurationError(str(error)) from error
        self._closed = False
        if self.common.mode == LOCKSTEP:
            self._poll_s = _LOCKSTEP_POLL_S
        self._others = [peer for peer in self.common.peers if peer != RECORDER]
        self._peer_parameters = PeerParameters(self, self.common.peers)
        self._topics: set[str] = set()
        self._recorded = self.endpoints.publisher(RUN_RECORDED)
        self._take_over(self._recordings.current)
        for topic in self.endpoints.topics:
            if not topic.is_from_outside:
                self._record(topic)
        self._recording.begin()
        if self.parameters.record_all:
            self.create_timer(_DISCOVERY_PERIOD_S, self._discover_topics)

    def clean_up(self) -> None:
        """Close the bag."""
        super().clean_up()
        self._close()

    @property
    def niceness(self) -> int:
        """Return how far the process stands back behind others.

        In lock step that is as its parameter says, as the plant waits for a recorder that is behind.
        """
        wanted = self.parameters.niceness
        return wanted if self.common.mode == LOCKSTEP else min(wanted, _REALTIME_NICENESS)

    def is_ready(self) -> bool:
        """Whether a bag is open, and the parameters of every node have been written into it."""
        if not self._run_is_over and not self._described and self._peer_parameters.poll():
            self._recording.describe(parameters=self._peer_parameters.values)
            self._described = True
        return self._described

    def reset_run(self) -> None:
        """Keep in mind that the bag is to be closed when all of the run has come."""
        self._run_is_over, self._described = True, False

    @property
    def counts(self) -> dict[str, int]:
        """Return the number of messages recorded so far, by topic."""
        return self._recording.writer.message_counts

    def report(self) -> NodeReport:
        """Return how much has been recorded."""
        values = {"messages": sum(self.counts.values()), "topics": len(self.counts)}
        return NodeReport(self._recording.simulation_ns, values)

    def run(self, executor: Executor, stop: Stop) -> int:
        """Record until the run is over and everything has come, or until asked to stop; close the bag."""
        try:
            while self.should_run(stop) and not (self.finished and self._drained()):
                self.turn(executor)
                self.inputs.poll_news()
            if stop.asked and self.active:
                self._drain(executor)
        finally:
            if not self._closed:
                self._recording.close()
            self.inputs.destroy()
        self._close()
        if not self.finished:
            return EXIT_STOPPED
        return EXIT_OK if self._recordings.complete else EXIT_LOSS

    def turn(self, executor: Executor) -> None:
        """Record what has come; between two runs, go on with the next bag."""
        executor.spin_once(timeout_sec=self._poll_s)
        nothing = not self.inputs.loop.poll()
        if not self.active:
            if not self._closed:
                self._peer_parameters.poll()  # so that the answers are there when the run could begin
            return
        self._flush(idle=nothing and monotonic() - self._last_message > _POLL_S)
        if self._run_is_over and not self.finished and self._drained():
            print(f"{self._recording.writer.folder}\n{ledger_table(self._recordings.begin_next())}\n")
            self._take_over(self._recordings.current)

    def _describe(self, recording: Recording) -> None:
        """Describe in a bag what it is made with."""
        urdf, schedule, made = self.robot.urdf, self.schedule.text, provenance(self.common.seed)
        recording.describe(urdf=urdf, schedule=schedule, scenario=self._scenario_text, provenance=made)

    def _take_over(self, recording: Recording) -> None:
        """Record into a bag that is open from now on."""
        self._recording = recording
        self._peer_parameters.ask_again()
        self._run_is_over = self._described = False
        self._counted: set[str] = set()
        self._last_message = monotonic()
        self._state_ns = self._flushed_ns = 0

    def _close(self) -> None:
        """Complete the bag and print what is in it, once."""
        if not self._closed:
            self._closed = True
            print(ledger_table(self._recordings.close()))

    def _flush(self, *, idle: bool) -> None:
        """Write to the file what has come, and report it to the plant, which does not go far ahead of it.

        Between two polls all that was published with a state has come. In an idle moment the last
        messages go out too, as they may not wait for others that do not come.
        """
        behind_ns = abs(self._state_ns - self._flushed_ns)
        if idle or behind_ns >= _FLUSH_NS:
            self._recording.writer.flush()
        if behind_ns and (idle or behind_ns >= _FLUSH_NS):
            self._flushed_ns = self._state_ns
            self._recorded.publish(Header(stamp=time_message(self._flushed_ns)))

    def _drained(self) -> bool:
        """Whether all of a run that is over has come."""
        silent = self.endpoints.not_publishing(RUN_PUBLISHED)
        if (self._counted | silent).issuperset(self._others) and self._recording.ledger.complete:
            return True
        return monotonic() - self._last_message > self.parameters.drain_timeout

    def _drain(self, executor: Executor) -> None:
        """Take what is on the way when the recorder is asked to stop, even if the graph goes on."""
        begin = self._last_message = monotonic()
        while self.inputs.loop.poll() or monotonic() - self._last_message < _QUIET_S:
            if monotonic() - begin > _DRAIN_S:
                break
            executor.spin_once(timeout_sec=_POLL_S)

    def _record(self, topic: Topic) -> None:
        profile = profile_of(topic)
        name = self.resolve_topic_name(topic.name)
        periods = {
            Rate.TICK: self.common.tick_ns,
            Rate.REFERENCE: self.common.reference_ns,
            Rate.OUTSIDE_REFERENCE: self.common.reference_ns,
            Rate.CLOCK: CLOCK_PERIOD_NS,
        }
        alone = len(topic.publishers) == 1
        evenly = alone and (self.common.mode == LOCKSTEP or topic.publishers == (PLANT,))
        self._open(name, topic.type, profile, periods.get(topic.rate, 0) if evenly else 0)
        self.endpoints.subscribe_serialized(topic.name, self.inputs.loop, self._on_serialized(topic, name))

    def _on_serialized(self, topic: Topic, name: str) -> OnSerialized:
        """Return what records every message of a topic, good or bad, and uses the good ones where needed.

        What others than the topic's own publishers send is recorded apart.
        """
        uses: dict[str, tuple[OnMessage[Any], Decode[Any]]] = {
            JOINT_STATES: (self._on_state, stamped),
            RUN_PUBLISHED: (self._on_counts, lambda data: decoded(data, PublishedCounts)),
        }
        use = self.message_filter.wrap(topic.name, *uses[topic.name]) if topic.name in uses else None
        if topic.is_global:
            return self._on_global(name, self.endpoints.own_of_global(topic.name))
        identity = None if topic.is_shared else self.endpoints.identity(topic.name)
        # others go on after the run: no sign that more is to come
        of_run = topic.rate is not Rate.WALL and not topic.is_shared

        def on_data(data: bytes, sent_ns: int, publisher: bytes) -> None:
            if identity is not None and not self._is_own(topic, identity, publisher, data):
                self._record_rejected(topic, data, sent_ns)
                return
            if of_run:
                self._last_message = monotonic()
            self._recording.receive(name, data, sent_ns)
            if use is not None:
                use(data, sent_ns, b"")

        return on_data

    def _on_global(self, name: str, identity: PublisherIdentity) -> OnSerialized:
        """Return what records the messages of this graph's nodes on a topic that graphs have in common."""

        def on_data(data: bytes, sent_ns: int, publisher: bytes) -> None:
            if publisher not in identity.own:
                try:
                    identity.require(publisher)
                except MessageError:
                    return
            self._recording.receive(name, data, sent_ns)

        return on_data

    def _is_own(self, topic: Topic, identity: PublisherIdentity, publisher: bytes, data: bytes) -> bool:
        """Whether a message is from the topic's own publishers.

        One that comes before discovery knows its publisher counts as that only if it is of the topic's type.
        """
        if publisher in identity.own:
            return True
        try:
            identity.require(publisher)
            if publisher and publisher not in identity.own:
                decoded(data, message_class(topic.type))
        except MessageError as error:
            self.message_filter.reject(topic.name, error)
            return False
        return True

    def _record_rejected(self, topic: Topic, data: bytes, sent_ns: int) -> None:
        """Record a message of another publisher on a topic of its own, where nothing counts for the run."""
        name = self.resolve_topic_name(topic.name) + REFUSED_TOPIC
        if name not in self._topics:
            self._open(name, topic.type, profile_of(topic), 0)
        self._recording.receive(name, data, sent_ns)

    def _open(self, name: str, type_name: str, profile: QoSProfile, period_ns: int) -> None:
        self._recordings.add_topic(name, type_name, (stored(profile),), period_ns)
        self._topics.add(name)

    def _on_state(self, state: Stamped[bytes], sent_ns: int) -> None:
        self._state_ns, _ = state

    def _on_counts(self, message: PublishedCounts, sent_ns: int) -> None:
        self._counted.add(message.node)

    def _discover_topics(self) -> None:
        """Record topics beyond the graph, with the quality of service that their publishers offer."""
        found = self.get_topic_names_and_types()
        own = self.resolve_topic_name(RUN_STATE)
        others = of_other_graphs(found, own, self.endpoints.topics)
        for name, type_names in found:
            if name in self._topics or name in others:
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers:
                continue
            self._topics.add(name)
            offers = [publisher.qos_profile for publisher in publishers]
            try:
                self._recordings.add_topic(name, type_names[0], list(dict.fromkeys(map(stored, offers))))
                kind = message_class(type_names[0])
            except SmsHandoverError as error:
                self.get_logger().warning(f"{name} is not recorded: {error}")
                continue
            on_data = partial(self._on_other, name)
            self.create_subscription(kind, name, on_data, weakest(offers), raw=True)

    def _on_other(self, name: str, data: bytes) -> None:
        """Record one message of a topic beyond the graph, which comes by the executor."""
        self._recording.receive(name, data, time_ns())


def of_other_graphs(
    found: Iterable[tuple[str, Sequence[str]]], own: str, topics: Iterable[Topic]
) -> frozenset[str]:
    """Return which of the topics found belong to another graph: they go into a bag of its own.

    ``found`` are topics with their types. Another graph is known by its run state, which ours has as ``own``;
    all in its namespace is its, of one without a namespace the ``topics`` that every graph has.
    """
    types = dict(found)
    states = {name for name, kinds in types.items() if RUN_STATE_TYPE in kinds} - {own}
    begins = tuple(
        {name.removesuffix(RUN_STATE) for name in states if name.endswith(f"/{RUN_STATE}")} - {"/"}
    )
    left = {name for name in types if name.startswith(begins)}
    if f"/{RUN_STATE}" in states:
        left |= {f"/{topic.name}" for topic in topics if not topic.is_global}
    return frozenset(left)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(RecorderNode, args, name=RECORDER)


if __name__ == "__main__":
    raise SystemExit(main())
