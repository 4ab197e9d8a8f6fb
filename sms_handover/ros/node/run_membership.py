"""Run membership: when a node is ready for a run, what it has published at its end, and the reset."""

from collections.abc import Callable

from sms_handover_interfaces.msg import PublishedCounts, RunState
from std_msgs.msg import String

from sms_handover.graph.topics import DIAGNOSTICS, LOOP_NODES, PLANT, RUN_PUBLISHED, RUN_READY, RUN_STATE
from sms_handover.ros.node.endpoints import CountedPublisher, Endpoints
from sms_handover.ros.node.lifecycle_node import LifecycleNode
from sms_handover.ros.node.node_inputs import NodeInputs

_MATCHING_PERIOD_S = 0.02  # [s] of wall time between two polls for who has matched


class RunMembership:
    """Takes a node through the runs of its graph; ``finished`` is whether the current one has ended.

    A run starts when every node is active, has found the endpoints it needs and has said so on
    ``run/ready``; when the plant, which leads the run, says that it has ended or is reset, every node of the
    loop publishes how many messages it has sent.
    """

    def __init__(
        self,
        node: LifecycleNode,
        *,
        is_ready: Callable[[], bool],
        on_matched: Callable[[], None],
        on_end: Callable[[], None],
        reset: Callable[[], None],
    ) -> None:
        """Ask ``is_ready`` besides the endpoints; call the others when it is due."""
        self._node, self._is_ready, self._on_matched = node, is_ready, on_matched
        self._on_end, self._reset = on_end, reset
        self.finished = False

    def join(self, endpoints: Endpoints, inputs: NodeInputs) -> None:
        """Make the endpoints that take part in the start and end of a run, and start to look for peers."""
        self._endpoints, self._inputs = endpoints, inputs
        self.finished = False
        self._counts = endpoints.publisher(RUN_PUBLISHED)
        self._ready: CountedPublisher | None = None
        if self._node.get_name() != PLANT:
            self._ready = endpoints.publisher(RUN_READY)
            inputs.subscribe_news(RUN_STATE, RunState, self._on_run_state)
        self.matching = self._node.create_timer(_MATCHING_PERIOD_S, self._poll_matching)

    def rejoin(self) -> None:
        """Look for the peers of the next run, and count its messages."""
        self._endpoints.reset_run()
        self.matching.reset()

    @property
    def has_matched(self) -> bool:
        """Whether every endpoint has matched, and what is due then has been done."""
        return bool(self.matching.is_canceled())

    def end(self) -> None:
        """Do what is due at the end of a run, and publish how many messages have gone out on its topics."""
        self._on_end()
        counts = self._endpoints.counts
        for name in (RUN_PUBLISHED, DIAGNOSTICS, RUN_READY):  # they go on between runs
            counts.pop(self._node.resolve_topic_name(name), None)
        self._counts.publish(
            PublishedCounts(node=self._node.get_name(), topics=list(counts), counts=list(counts.values()))
        )

    def _poll_matching(self) -> None:
        """Go on once the node is active and every endpoint has matched."""
        if self._node.active and not self._endpoints.unmatched and self._is_ready():
            self.matching.cancel()
            if self._ready is not None:
                self._ready.publish(String(data=self._node.get_name()))
            self._on_matched()

    def _on_run_state(self, message: RunState) -> None:
        """Take notice of the end of the run, and get ready for the next if the plant waits for it."""
        ended = message.state in (RunState.FINISHED, RunState.FAILED)
        waits = message.state == RunState.WAITING
        if (ended or (waits and self.has_matched)) and not self.finished:
            self._inputs.loop.poll()  # answers may be due still; they belong to the counts
            if self._node.get_name() in LOOP_NODES:  # the recorder ends when everything has come
                self.end()
        self.finished = ended
        if waits:
            self._reset()
            self.rejoin()
