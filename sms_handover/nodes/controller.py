"""Controller node: answers every state with a joint command."""

from abc import abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from sms_handover.configuration.scenario_file import LAW
from sms_handover.control.law import Need
from sms_handover.control.parameters import ControllerParameters, parameters_with
from sms_handover.control.plan_events import PlanEvents
from sms_handover.control.protocol import Carrying, Controller, Planning, Remote, Showing, inner_of
from sms_handover.control.registry import law_named
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    CONTROLLER,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    MPC_STATUS,
    PLANNED_PATHS,
    TASK_PHASE,
    state_topics,
)
from sms_handover.nodes.parts.guidance_parts import GuidanceParts
from sms_handover.nodes.parts.marker import path_markers
from sms_handover.nodes.parts.watchdogs import ReferenceWatchdog
from sms_handover.ros.codecs.convert import plan_message
from sms_handover.ros.codecs.events import read_grasp_event
from sms_handover.ros.codecs.loop_messages import (
    JointStateCodec,
    PoseCodec,
    Stamped,
    StateCodec,
    coordinates,
    stamped,
)
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.ros.node.diagnostics import NodeReport
from sms_handover.ros.node.graph_node import GraphNode, P
from sms_handover.ros.node.message_filter import Decode
from sms_handover.ros.process.main import run_node
from sms_handover.ros.transport.stamp_sync import StampOrder, StampSync
from sms_handover.simulation.parameters import LOCKSTEP, REALTIME
from sms_handover.simulation.wiring import longest_reference_ns, make_controller
from sms_handover.units import NS_PER_S


class AnsweringNode(GraphNode[P]):
    """Answers every state with a joint command of the same stamp, by whatever controller.

    In lock step a state that falls on a reference period waits for its reference; in real time the
    last reference holds.
    """

    def __init__(self, group: type[P], *, shipped: bool = True) -> None:
        super().__init__(CONTROLLER, group, shipped=shipped)

    def prepare(self) -> None:
        """Set up the controller; raises what :meth:`make_controller` does."""
        self._controller = self.make_controller()
        self._no_effort = np.zeros(self.robot.n_joints)  # N m
        self._parts = GuidanceParts(self.robot.arms if self.follows_tools else ())
        self._lockstep = self.common.mode == LOCKSTEP
        self._tick_ns, self._reference_ns = self.common.tick_ns, self.common.reference_ns
        self._state_codec = StateCodec(self.robot.joint_names, WORLD, BASE)
        self._reference_codec = JointStateCodec(self.robot.joint_names, ("position", "velocity"))
        self._command_codec = JointStateCodec(self.robot.joint_names, ("effort",))
        self._phase_codec = PhaseCodec(self.robot.arms, self.schedule.deputy.grasp_frames)
        guidance: dict[str, Decode[Stamped[Any]]] = dict.fromkeys(
            self._parts.topics, PoseCodec(WORLD).checked
        )
        guidance[TASK_PHASE] = self._phase_codec.checked
        guidance[JOINT_REFERENCE] = self._reference_codec.checked
        self._state = self._joints, self._odometry = state_topics(measured=self.common.uses_measurements)
        state: dict[str, Decode[Stamped[Any]]] = {
            self._joints: self._state_codec.joints.checked,
            self._odometry: self._state_codec.odometry.checked,
        }
        self._everything = (*self._state, *guidance)
        ahead_ns = self._reference_ns if self._lockstep else NS_PER_S
        self._inputs: StampSync[Any] = StampSync(ahead_ns=ahead_ns, paced=not self._lockstep)
        self._orders = {topic: StampOrder(ahead_ns) for topic in guidance}
        self._early: dict[str, Any] = {}  # what may belong to the next run
        self._answered_ns = 0
        self._answer_bytes = b""
        for topic, read in {**guidance, **state}.items():
            self.inputs.subscribe(topic, partial(self._on_input, topic), read)
        self._forget_grasps()
        if isinstance(self._controller, Carrying):
            self.inputs.subscribe(GRASP_EVENT, self._on_grasp, stamped)
        self._command = self.endpoints.publisher(JOINT_COMMAND)  # last: then all of an external node is there

    @property
    @abstractmethod
    def law(self) -> str:
        """The name of the law in reports."""

    @property
    @abstractmethod
    def follows_tools(self) -> bool:
        """Whether the controller is given the targets of the tools."""

    @abstractmethod
    def make_controller(self) -> Controller:
        """Return what answers the states of the robot."""

    def begin(self) -> None:
        """Go back to the start of a run."""
        self._controller.reset()
        self._parts.reset()
        self._forget_grasps()
        for order in self._orders.values():
            order.reset()

    def on_answered(self, stamp: int) -> None:
        """Do what is due after an answer; a node may override this."""

    def reset_run(self) -> None:
        """Forget the run: integrals, references and what waits of it."""
        self.begin()
        self._inputs.reset_run()
        self._early.clear()
        self._answered_ns = 0
        self._answer_bytes = b""

    def report(self) -> NodeReport:
        """Return what has been answered and what came too late."""
        values = {"law": self.law, "answered": self._command.count, "late": self._inputs.dropped}
        return NodeReport(self._answered_ns, values)

    @property
    def awaited(self) -> str:
        """The last of the inputs of the next state."""
        if self._waits_for_grasps:
            return GRASP_EVENT
        stamp = self._inputs.oldest_ns
        if stamp is None:
            stamp = self._answered_ns + self._tick_ns if self._command.count else 0
        return self._inputs.missing(stamp, self._needed(stamp)) or self._odometry

    @property
    def answer_is_near(self) -> bool:
        """Whether only the plant has to work: for a reference trajectory and ik have to before."""
        return self.awaited in self._state

    def _needed(self, stamp: int) -> tuple[str, ...]:
        """Return the inputs that belong to a stamp, the last one to come last."""
        return self._everything if self._lockstep and stamp % self._reference_ns == 0 else self._state

    def _on_input(self, topic: str, message: Stamped[Any], sent_ns: int) -> None:
        """Take one input; a state of time zero after an answered one restarts the run.

        A reference of time zero waits for such a state: it may belong to one that the plant has resent.
        """
        stamp, content = message
        if self._inputs.restarts_run(stamp):
            if topic not in self._state:
                self._early[topic] = content
                return
            self._inputs.reset()
            self.begin()
            early, self._early = self._early, {}
            for name, first in early.items():
                self._on_input(name, (stamp, first), sent_ns)
        if not self._lockstep and topic in self._orders:
            if self._inputs.admits(stamp, topic):
                self._orders[topic].accept(stamp, self._answered_ns)
                self._guide(topic, stamp, content)
            return
        if topic == self._odometry and stamp == self._answered_ns and self._lockstep and self._answer_bytes:
            self._command.publish(self._answer_bytes)  # the plant has resent it: it has missed the answer
        self._inputs.add(stamp, topic, content)
        self._answer(stamp)

    @property
    def _waits_for_grasps(self) -> bool:
        """Whether the result of a grasp that was commanded is still to come (lock step)."""
        stamp, count = self._commanded
        return self._lockstep and self._heard[stamp] < count

    def _forget_grasps(self) -> None:
        """Await no result of a grasp."""
        self._commanded = 0, 0  # stamp of the latest grasp commands, and how many they were
        self._heard: Counter[int] = Counter()  # results by stamp

    def _on_grasp(self, message: Stamped[bytes], sent_ns: int) -> None:
        """Take the result of a grasp; the next state may have come before it."""
        event = read_grasp_event(message[1])
        if self._lockstep and (not self._answer_bytes or event.stamp_ns > self._answered_ns):
            return  # it is of the run before: the plant decides once the state has been answered
        if isinstance(self._controller, Carrying):
            self._controller.grasped(event)
        self._heard[event.stamp_ns] += 1
        waiting = self._inputs.oldest_ns
        if waiting is not None:
            self._answer(waiting)

    def _answer(self, stamp: int) -> None:
        """Publish the command of a state as soon as everything that belongs to it has come."""
        if self._waits_for_grasps:
            return
        needed = self._needed(stamp)
        inputs = self._inputs.take(stamp, needed)
        if inputs is None:
            return
        if needed is self._everything:
            for topic in self._orders:
                self._guide(topic, stamp, inputs[topic])
            commands = inputs[TASK_PHASE].commands
            if commands and isinstance(self._controller, Carrying):
                self._commanded = stamp, len(commands)
        q, v = coordinates(inputs[self._joints], inputs[self._odometry])
        effort = self._controller.effort(stamp, q, v) if self._parts.complete else self._no_effort
        self._answer_bytes = self._command_codec.pack(stamp, effort=effort)
        self._command.publish(self._answer_bytes)
        self._answered_ns = stamp
        self.on_answered(stamp)

    def _guide(self, topic: str, stamp: int, content: Any) -> None:
        """Guide the controller once all parts of an instant are there."""
        guidance = self._parts.add(topic, stamp, content)
        if guidance is not None:
            self._controller.guide(guidance)


class ControllerNode(AnsweringNode[ControllerParameters]):
    """Answers every state with a joint command of the same stamp, under a law of the registry.

    In lock step a state that falls on a reference period waits for its reference; in real time the
    last reference holds.
    """

    def __init__(self) -> None:
        super().__init__(ControllerParameters)
        self._remote: Remote | None = None

    def parameter_group(
        self, group: type[ControllerParameters], scenario: Mapping[str, object]
    ) -> type[ControllerParameters]:
        """Return the parameters of the controller with those of the law that was given."""
        name = self.get_parameter(LAW).value if self.has_parameter(LAW) else scenario.get(LAW)
        if name is None:
            return group
        law = law_named(str(name), f"{CONTROLLER}: parameter {LAW!r}")
        return parameters_with(law, type(self.common))

    def prepare(self) -> None:
        """Set up the law; raises UnstableLoopError if its gains cannot work at this tick."""
        self._plans = self.endpoints.publisher(MPC_STATUS)
        self._lines = self.endpoints.publisher(PLANNED_PATHS)
        super().prepare()
        inner = inner_of(self._controller)
        self._solves = inner if isinstance(inner, Planning) else None
        self._remote = inner if isinstance(inner, Remote) else None
        self._shows = inner if isinstance(inner, Showing) else None
        self._plan_events = PlanEvents()
        self._watchdog = ReferenceWatchdog(longest_reference_ns(self.common, self.parameters))

    @property
    def law(self) -> str:
        """The name of the law."""
        return self.parameters.law

    @property
    def follows_tools(self) -> bool:
        """Whether the law needs the targets of the tools."""
        return Need.TOOL_TARGETS in law_named(self.law).needs

    def make_controller(self) -> Controller:
        """Return the controller that the parameters ask for; raises ConfigurationError."""
        real_time = self.common.mode == REALTIME
        return make_controller(
            self.robot, self.schedule, self.common, self.parameters, in_real_time=real_time
        )

    def clean_up(self) -> None:
        """Give the inputs back to the middleware, and end the process of a solver."""
        super().clean_up()
        self._close()

    def destroy_node(self) -> None:
        """Destroy the node with its inputs, and end the process of a solver."""
        super().destroy_node()
        self._close()

    def _close(self) -> None:
        """End the process of a solver."""
        if self._remote:
            self._remote.close()
            self._remote = None

    def begin(self) -> None:
        """Go back to the start of a run."""
        super().begin()
        self._plan_events.reset()
        self._watchdog.reset()

    def on_answered(self, stamp: int) -> None:
        """Publish what came of a solve; in real time, report when references stop and come again."""
        report = self._solves.take_status() if self._solves else None
        if report:
            self._plans.publish(plan_message(report))
            trouble = self._remote.trouble if self._remote else ""
            self.events.publish_all(self._plan_events.of(report, trouble))
        paths = self._shows.take_paths() if self._shows else None
        if paths:
            self._lines.publish(path_markers(paths))
        if not self._lockstep:
            event = self._watchdog.poll(self._parts.reference_ns, stamp)
            if event is not None:
                self.events.publish(event)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ControllerNode, args, name=CONTROLLER)


if __name__ == "__main__":
    raise SystemExit(main())
