"""What every node of the graph does alike: parameters, matching, readiness, counts, diagnostics."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import Executor
from rclpy.node import Node
from sms_handover_interfaces.msg import PublishedCounts, RunState
from std_msgs.msg import String

from sms_handover.configuration.parameters import EVERY_NODE
from sms_handover.errors import ConfigurationError, MessageError, Reason
from sms_handover.graph.events import MESSAGE_REFUSED, Severity
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    PLANT,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_READY,
    RUN_STATE,
    graph_topics,
)
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.codecs.loop_messages import decoded
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.node.event_publisher import EventPublisher
from sms_handover.ros.node.lifecycle_node import LifecycleNode
from sms_handover.ros.node.message_filter import REFUSED, MessageFilter, Read, Receive
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_OK, WAIT_S, RunnableNode, Stop
from sms_handover.ros.process.realtime import settle
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.inputs import ExecutorInputs, Inputs
from sms_handover.simulation.parameters import DIRECT, EXECUTOR, LOCKSTEP, CommonParameters
from sms_handover.simulation.scenario import load_robot_model

P = TypeVar("P")
T = TypeVar("T")

INPUTS: dict[str, Callable[[Node], Inputs]] = {DIRECT: DirectInputs, EXECUTOR: ExecutorInputs}

_DIAGNOSTICS_PERIOD_S = 1.0  # [s] of wall time
_NEWS_PERIOD_S = 0.02  # [s] of wall time between two looks for news of the run
_MATCHING_PERIOD_S = 0.02  # [s] of wall time between two looks at who has matched


class GraphNode(LifecycleNode, Generic[P]):
    """A node with its parameter group ``P``, its endpoints, and its part in start and end of a run.

    A run starts when every node is active, has found the endpoints it needs and has said so on
    ``run/ready``; when the plant says that it has ended, every node tells how much it has published.
    """

    def __init__(self, name: str, group: type[P], *, shipped: bool = True) -> None:
        """Declare the parameters; what is wrong with them is told when the node is configured.

        Unless the group is ``shipped`` with a file in ``config/`` its fields have the defaults.
        """
        super().__init__(name)
        self._refusal: ConfigurationError | None = None
        self.finished = False
        self.inputs: Inputs = ExecutorInputs(self)
        self.news: Inputs = ExecutorInputs(self)  # of the run, which count whether active or not
        self._company: tuple[GraphNode[Any], ...] = (self,)
        self._news_at = 0.0
        try:
            self.common: CommonParameters = declare(self, CommonParameters, "common.yaml", EVERY_NODE)
            self.parameters: P = declare(self, group, f"{name}.yaml" if shipped else None, name)
            reject_unknown(self, CommonParameters, group)
            self.inputs, self.news = (INPUTS[self.common.transport](self) for _ in range(2))
            self.inputs.awaited = lambda: self.awaited
        except ConfigurationError as error:
            self._refusal = error
        self.inputs.close(drop=False)

    # Transitions; docs/lifecycle.md tells what each means for the run

    def start(self) -> None:
        """Configure and activate, unless somebody else is to: parameter ``autostart``."""
        if self._refusal is not None or self.common.autostart:
            super().start()

    def configure(self) -> None:
        """Load the robot and make the endpoints; raises ConfigurationError."""
        if self._refusal is not None:
            raise self._refusal
        name = self.get_name()
        self.robot: RobotModel = load_robot_model(self.common)
        self.endpoints = Endpoints(
            self, graph_topics(self.robot.arms), self.common.peers, self.common.external
        )
        self.refusals = MessageFilter(self.get_logger().warning, self._on_refusal)
        self.finished = False
        self._counts = self.endpoints.publisher(RUN_PUBLISHED)
        self.events = EventPublisher(self, self.endpoints.publisher(RUN_EVENTS))
        self._diagnostics = self.endpoints.publisher(DIAGNOSTICS)
        if name != PLANT:
            self._ready = self.endpoints.publisher(RUN_READY)
            self.hear(RUN_STATE, RunState, self._on_run_state)
        self.prepare()
        self._matching = self.create_timer(_MATCHING_PERIOD_S, self._look_for_peers)
        self.create_timer(_DIAGNOSTICS_PERIOD_S, self.publish_diagnostics)
        self.settle()

    def prepare(self) -> None:
        """Make what a node has beyond that; a node overrides this. Raises SmsHandoverError."""

    def activate(self) -> None:
        """Take part in the run: what has waited in lock step is worked on now."""
        self.inputs.open()

    def deactivate(self) -> None:
        """Take no more part: in lock step what comes waits, in real time it is lost."""
        self.inputs.close(drop=self.common.mode != LOCKSTEP)

    def clean_up(self) -> None:
        """Give the inputs back to the middleware."""
        self.news.destroy()
        self.inputs.destroy()
        self.inputs.close(drop=False)

    def run(self, executor: Executor, stop: Stop) -> int:
        """Handle events until asked to stop or shut down, and return the exit code."""
        while self.goes_on(stop):
            self.turn(executor)
            self.look_for_news()
        return EXIT_OK

    def look_for_news(self) -> None:
        """Take the news of the run that have come, for the nodes of the same process too, now and then."""
        now = monotonic()
        if now >= self._news_at:
            self._news_at = now + _NEWS_PERIOD_S
            for node in self._company:
                node.news.poll()

    def turn(self, executor: Executor) -> None:
        """Handle what has come, or wait a little for something to come; a node may override this."""
        self.inputs.spin_once(executor, WAIT_S)

    def accompany(self, others: Sequence[RunnableNode]) -> None:
        """Serve the inputs of other nodes of the same process in the loop of this one."""
        company = tuple(other for other in others if isinstance(other, GraphNode))
        self.keep_company(company)
        self._company = (self, *company)
        self.inputs.accompany([other.inputs for other in company])

    @property
    def awaited(self) -> str:
        """Return the input that the loop waits for, "" if it has none; a node may override this."""
        return ""

    def destroy_node(self) -> None:
        """Destroy the node with its inputs."""
        self.news.destroy()
        self.inputs.destroy()
        super().destroy_node()

    def receive(self, name: str, receive: Receive[T], read: Read[T]) -> None:
        """Hand to ``receive`` what ``read`` finds in the good messages of a topic's own publisher."""
        sender = self.endpoints.sender(name)
        self.endpoints.receive(name, self.inputs, self.refusals.guarding(name, receive, read, sender))

    def hear(self, name: str, kind: Any, take: Callable[[Any], None]) -> None:
        """Hand to ``take`` the good messages of a topic that comes seldom and counts in every state."""
        guarded = self.refusals.guarding(
            name,
            lambda message, sent_ns: take(message),
            lambda data: decoded(data, kind),
            self.endpoints.sender(name),
        )
        self.endpoints.receive(name, self.news, guarded)

    def settle(self) -> None:
        """Set up the process as the parameters ask; raises ConfigurationError. A node may override this."""
        settle(self.common)

    def prepared(self) -> bool:
        """Whether this node has what it needs besides its topics; a node may override this."""
        return True

    @property
    def has_matched(self) -> bool:
        """Whether every endpoint has matched, and what is due then has been done."""
        return bool(self._matching.is_canceled())

    def on_matched(self) -> None:
        """Do what is due once every endpoint has matched: by default, say that this node is ready."""
        self._ready.publish(String(data=self.get_name()))

    def reset_run(self) -> None:
        """Forget the run, as if this node had just been configured; a node overrides this."""

    def on_end(self) -> None:
        """Do what is due at the end of the run: by default, tell how it went and what has been published."""
        self.publish_diagnostics()
        self.publish_counts()

    def diagnostic_values(self) -> dict[str, object]:
        """Return what the diagnostics of this node tell; a node may override this."""
        return {}

    def diagnosis(self) -> tuple[int, str]:
        """Return level and words of the diagnostics of a running node; a node may override this."""
        return 0, ""

    def diagnostic_stamp_ns(self) -> int:
        """Return the simulation time of the diagnostics; a node may override this."""
        return 0

    def publish_counts(self) -> None:
        """Tell how many messages have gone out on every topic that ends with the run."""
        counts = self.endpoints.counts
        between_runs = [] if self.get_name() == PLANT else [self._ready]
        for publisher in (self._counts, self._diagnostics, *between_runs):
            del counts[publisher.topic_name]
        self._counts.publish(
            PublishedCounts(node=self.get_name(), topics=list(counts), counts=list(counts.values()))
        )

    def _on_refusal(self, topic: str, error: MessageError) -> None:
        """Tell everybody of the first message of a topic that is refused for a reason."""
        detail = f"{topic}: {error.reason.value}: {error}"
        self.events.tell(MESSAGE_REFUSED, Severity.WARNING, detail, self.diagnostic_stamp_ns())

    def _look_for_peers(self) -> None:
        """Go on once this node is active and every endpoint has matched."""
        if self.active and not self.endpoints.unmatched and self.prepared():
            self._matching.cancel()
            self.on_matched()

    def _on_run_state(self, message: RunState) -> None:
        """Take notice of the end of the run, and get ready for the next if the plant waits for it."""
        ended = message.state in (RunState.FINISHED, RunState.FAILED)
        waits = message.state == RunState.WAITING
        if (ended or (waits and self.has_matched)) and not self.finished:
            self.inputs.poll()  # answers may be due still; they belong to the counts
            self.on_end()
        self.finished = ended
        if waits:
            self.reset_run()
            self.look_again()

    def look_again(self) -> None:
        """Say that this node is ready for the next run as soon as it is."""
        self.endpoints.reset_run()
        self._matching.reset()

    def publish_diagnostics(self) -> None:
        """Publish the state of this node; it does so itself once a second and at the end of the run.

        Raises MessageError if another node publishes where one alone is to, and the transport does not tell
        their messages apart.
        """
        self.refusals.tell()
        if not self.inputs.identifies and self.has_matched and self.endpoints.intruders:
            text = f"waiting in vain for {self.endpoints.intruders[0]}; only with transport {DIRECT!r}"
            raise MessageError(Reason.SENDER, f"{text} its messages can be told apart")
        waiting = [] if self.has_matched else self.endpoints.unmatched
        if not self.active:
            waiting = ["somebody to activate it"]
        level, words = self.diagnosis()
        refused = self.refusals.counts
        if refused and not level:
            level, words = 1, f"refused {', '.join(f'{kind} ({count})' for kind, count in refused.items())}"
        told = {**self.diagnostic_values(), "wakes": self.inputs.wakes}
        told.update((REFUSED + kind, count) for kind, count in refused.items())
        values = [KeyValue(key=key, value=str(value)) for key, value in told.items()]
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if waiting else bytes([level]),
            name=self.get_name(),
            message="waiting for " + ", ".join(waiting) if waiting else words or "running",
            values=values,
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = time_message(self.diagnostic_stamp_ns())
        self._diagnostics.publish(message)
