"""Graph node: what every node of the graph is made of, and the hooks by which they differ."""

from collections.abc import Mapping, Sequence
from typing import Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import Executor

from sms_handover.conditions.conditions import Conditions
from sms_handover.configuration.parameters import EVERY_NODE
from sms_handover.configuration.scenario_file import COMMON
from sms_handover.configuration.values import MODEL, TRUTH
from sms_handover.errors import ConfigurationError, MessageError, Reason
from sms_handover.graph.events import MESSAGE_REFUSED, RunEvent, Severity
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    LOOP_NODES,
    PLANT,
    RECORDER,
    RUN_EVENTS,
    graph_topics,
    sensor_topic,
)
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.node.diagnostics import NodeReport, diagnostics_message
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.node.event_publisher import EventPublisher
from sms_handover.ros.node.lifecycle_node import LifecycleNode
from sms_handover.ros.node.message_filter import MessageFilter
from sms_handover.ros.node.node_inputs import NodeInputs
from sms_handover.ros.node.run_membership import RunMembership
from sms_handover.ros.parameters import declare, named_scenario, reject_unknown
from sms_handover.ros.process.main import EXIT_OK, WAIT_S, RunnableNode, Stop
from sms_handover.ros.process.realtime import settle
from sms_handover.ros.transport.spinning import spin_of
from sms_handover.simulation.parameters import DIRECT, EXECUTOR, LOCKSTEP, CommonParameters
from sms_handover.simulation.scenario import deputy_masses, load_world
from sms_handover.trajectory.schedule import Schedule

P = TypeVar("P")

WITH_TRUTH = (PLANT, RECORDER)  # the nodes that have the true robot and deputy; every other has a model
_DIAGNOSTICS_PERIOD_S = 1.0  # [s] of wall time


class GraphNode(LifecycleNode, Generic[P]):
    """A node with its parameter group ``P`` that takes part in the runs of a graph.

    It holds ``endpoints``, ``inputs``, ``message_filter``, ``events`` and its ``membership`` in the run. What
    differs between nodes is in the hooks, :meth:`prepare` to :meth:`turn`, and in the transitions.
    """

    def __init__(self, name: str, group: type[P], *, shipped: bool = True) -> None:
        """Declare the parameters; an error in them is raised when the node is configured.

        Unless the group is ``shipped`` with a file in ``config/`` its fields have the defaults.
        """
        super().__init__(name)
        self._invalid: ConfigurationError | None = None
        transport = EXECUTOR
        try:
            self.scenario = named_scenario(self)
            given = self.scenario.parameters
            common, own = given[COMMON], given.get(name) if shipped else None
            self.common: CommonParameters = declare(self, CommonParameters, "common.yaml", EVERY_NODE, common)
            group = self.parameter_group(group, own or {})
            self.parameters: P = declare(self, group, f"{name}.yaml" if shipped else None, name, own)
            reject_unknown(self, CommonParameters, group)
            transport = self.common.transport
        except ConfigurationError as error:
            self._invalid = error
        self.inputs = NodeInputs(self, transport, lambda: self.awaited)
        self.membership = RunMembership(
            self,
            is_ready=self.is_ready,
            on_matched=self.on_matched,
            on_end=self.publish_diagnostics,
            reset=self.reset_run,
        )

    # Hooks

    def parameter_group(self, group: type[P], scenario: Mapping[str, object]) -> type[P]:
        """Return the parameters to declare, which may depend on those given here and by the scenario.

        Raises ConfigurationError.
        """
        return group

    def prepare(self) -> None:
        """Make what the node needs beyond its part in the run; raises SmsHandoverError."""

    def is_ready(self) -> bool:
        """Whether the node has what it needs besides its topics."""
        return True

    def on_matched(self) -> None:
        """Do what is due once the node has found what it needs for a run."""

    def reset_run(self) -> None:
        """Forget the run, as if the node had just been configured."""

    def report(self) -> NodeReport:
        """Return what the diagnostics of the node have to say."""
        return NodeReport()

    @property
    def awaited(self) -> str:
        """The input that the loop waits for, "" if it has none."""
        return ""

    @property
    def answer_is_near(self) -> bool:
        """Whether what the loop waits for comes from one node that has all it needs for it."""
        return True

    def turn(self, executor: Executor) -> None:
        """Handle what has come, or wait a little for something to come."""
        self.inputs.loop.spin_once(executor, WAIT_S)

    # Transitions; docs/lifecycle.md has what each means for the run

    def start(self) -> None:
        """Configure and activate, unless somebody else is to: parameter ``autostart``."""
        if self._invalid is not None or self.common.autostart:
            super().start()

    def configure(self) -> None:
        """Load robot and schedule and make the endpoints; raises ConfigurationError."""
        if self._invalid is not None:
            raise self._invalid
        role = TRUTH if self.get_name() in WITH_TRUTH else MODEL
        world = load_world(self.common, role, self.scenario)
        self.common = self.common.for_deputies(*deputy_masses(self.common, self.scenario, role, world))
        self.robot: RobotModel = world.robot
        self.schedule: Schedule = world.schedule
        self.conditions: Conditions = world.conditions
        topics = graph_topics(
            self.robot.arms,
            clearance=self.common.measures_clearance,
            sensors=[sensor_topic(name) for name in world.conditions.sensors],
            measured=self.common.uses_measurements,
        )
        self.endpoints = Endpoints(self, topics, self.common.peers, self.common.external)
        self.message_filter = MessageFilter(self.get_logger().warning, self._on_first_rejected)
        self.inputs.connect(self.endpoints, self.message_filter)
        self.membership.join(self.endpoints, self.inputs)
        self.events = EventPublisher(self, self.endpoints.publisher(RUN_EVENTS))
        self._diagnostics = self.endpoints.publisher(DIAGNOSTICS)
        self.prepare()
        self.create_timer(_DIAGNOSTICS_PERIOD_S, self.publish_diagnostics)
        if self.get_name() in LOOP_NODES:  # processor and priority are for those
            settle(self.common)
        self.inputs.loop.spin = spin_of(self.get_name(), self.common, lambda: self.answer_is_near)

    def activate(self) -> None:
        """Take part in the run: what has waited in lock step is worked on now."""
        self.inputs.loop.open()

    def deactivate(self) -> None:
        """Take no more part: in lock step what comes waits, in real time it is lost."""
        self.inputs.loop.close(drop=self.common.mode != LOCKSTEP)

    def clean_up(self) -> None:
        """Give the inputs back to the middleware."""
        self.inputs.destroy()
        self.inputs.loop.close(drop=False)

    # The process

    def run(self, executor: Executor, stop: Stop) -> int:
        """Handle events until asked to stop or shut down, and return the exit code."""
        while self.should_run(stop):
            self.turn(executor)
            self.inputs.poll_news()
        return EXIT_OK

    def accompany(self, others: Sequence[RunnableNode]) -> None:
        """Serve the inputs of other nodes of the same process in the loop of this one."""
        super().accompany(others)
        self.inputs.accompany([other.inputs for other in others if isinstance(other, GraphNode)])

    def destroy_node(self) -> None:
        """Destroy the node with its inputs."""
        self.inputs.destroy()
        super().destroy_node()

    @property
    def finished(self) -> bool:
        """Whether the run has ended."""
        return self.membership.finished

    def publish_diagnostics(self) -> None:
        """Publish the diagnostics; the node does so itself once a second and at the end of the run.

        Raises MessageError if another node publishes where one alone is to, and the transport does not tell
        their messages apart.
        """
        self.message_filter.report()
        matched = self.membership.has_matched
        if not self.inputs.loop.identifies and matched and (others := self.endpoints.other_publishers):
            text = f"cannot wait for {others[0]}: only transport {DIRECT!r} can tell its messages apart"
            raise MessageError(Reason.SENDER, text)
        waiting = [] if matched else self.endpoints.unmatched
        message: DiagnosticArray = diagnostics_message(
            self.get_fully_qualified_name(),
            self.report(),
            wakes=self.inputs.loop.wakes,
            waiting=waiting if self.active else ["somebody to activate it"],
            rejected=self.message_filter.counts,
        )
        self._diagnostics.publish(message)

    def _on_first_rejected(self, topic: str, error: MessageError) -> None:
        """Report the first message of a topic that is rejected for a reason as an event."""
        detail = f"{topic}: {error.reason.value}: {error}"
        now_ns = self.report().stamp_ns
        self.events.publish(RunEvent(now_ns, self.get_name(), MESSAGE_REFUSED, Severity.WARNING, detail))
