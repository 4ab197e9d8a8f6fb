"""The launcher's ear: progress, grasp events, who waits for whom, and the request to finish."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PoseStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from sms_handover_interfaces.msg import GraspEvent as GraspEventMessage
from sms_handover_interfaces.msg import PublishedCounts, RunState
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage
from std_srvs.srv import Trigger

from sms_handover.graph.events import RunEvent, Severity
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    GRASP_EVENT,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_STATE,
    TASK_PHASE,
    target_pose,
    tool_pose,
)
from sms_handover.launcher.monitor import RunMonitor
from sms_handover.ros.codecs.convert import (
    event_message,
    header,
    phase_message,
    run_event_message,
)
from sms_handover.ros.node.node_inputs import INPUTS
from sms_handover.ros.qos import LATCHED, LOSSLESS
from sms_handover.ros.transport.inputs import ExecutorInputs, Inputs
from sms_handover.simulation.parameters import DIRECT
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus, TaskPhase

from .bench import Bench

pytestmark = pytest.mark.ros


def position_stamped(x: float, y: float, z: float) -> PoseStamped:
    message = PoseStamped(header=header(0))
    message.pose.position = Point(x=x, y=y, z=z)
    return message


class FakeGraph:
    """A node named plant that says whatever it is told to, and a monitor that listens."""

    def __init__(self, bench: Bench, inputs: Callable[[Node], Inputs]) -> None:
        """Start ROS and match what is volatile."""
        bench.start()
        self.bench = bench
        self.node: Node = bench.plain("plant")
        launcher = bench.loose("launcher")
        self._inputs = inputs(launcher)
        self.monitor = RunMonitor(launcher, ("arm_a", "arm_b"), self._inputs)
        bench.spin(launcher)
        self.publishers: dict[str, Publisher] = {}

    def say(self, topic: str, message: Any) -> None:
        """Publish a message, once there is somebody to hear it."""
        profile = LATCHED if topic in (RUN_STATE, RUN_EVENTS, GRASP_EVENT, RUN_PUBLISHED) else LOSSLESS
        if topic not in self.publishers:
            self.publishers[topic] = self.node.create_publisher(type(message), topic, profile)
        publisher = self.publishers[topic]
        self.bench.until(lambda: publisher.get_subscription_count() == 1, f"the match of {topic}")
        publisher.publish(message)

    def until(self, condition: Callable[[], object], what: str, *said: tuple[str, Any]) -> None:
        """Say things again and again until a condition holds: a display may miss what is not latched."""

        def heard() -> object:
            for topic, message in said:
                self.say(topic, message)
            self.monitor.look()
            return condition()

        self.bench.until(heard, what)

    def destroy(self) -> None:
        """Give back to the middleware what no node knows of."""
        self._inputs.destroy()

    def state(self, state: int, stamp_ns: int, detail: str = "") -> None:
        """Say in which state the run is."""
        self.say(RUN_STATE, RunState(header=header(stamp_ns), state=state, detail=detail))


@pytest.fixture(params=list(INPUTS))
def graph(request: pytest.FixtureRequest, bench: Bench) -> Iterator[FakeGraph]:
    graph = FakeGraph(bench, INPUTS[request.param])
    yield graph
    graph.destroy()


def test_progress_is_followed(graph: FakeGraph) -> None:
    progress = graph.monitor.progress
    assert (progress.state, progress.stamp_ns, graph.monitor.finished) == (RunState.WAITING, 0, False)
    graph.state(RunState.RUNNING, 0)
    graph.until(lambda: progress.state == RunState.RUNNING, "the start")
    phase = phase_message(TaskPhase(40_000_000, 1, "carry"))
    graph.until(lambda: progress.phase == "carry", "the phase", (TASK_PHASE, phase))
    assert progress.stamp_ns == 40_000_000
    graph.state(RunState.FINISHED, 50_000_000, "run complete")
    graph.until(lambda: graph.monitor.finished, "the end")
    assert (progress.stamp_ns, progress.detail) == (50_000_000, "run complete")


def test_a_failed_run_is_over_too(graph: FakeGraph) -> None:
    graph.state(RunState.FAILED, 7, "why")
    graph.until(lambda: graph.monitor.finished, "the end")


def test_a_reset_sets_the_time_back(graph: FakeGraph) -> None:
    graph.state(RunState.FINISHED, 50_000_000)
    graph.until(lambda: graph.monitor.finished, "the end")
    graph.state(RunState.RUNNING, 0, "reset")
    graph.until(lambda: not graph.monitor.finished, "the second start")
    assert graph.monitor.progress.stamp_ns == 0


def test_grasp_events_are_kept_in_order(graph: FakeGraph) -> None:
    nan = float("nan")
    events = [
        GraspEvent(
            20,
            GraspCommand(GraspAction.GRASP, "arm_a", "end_a"),
            GraspStatus.MISSED,
            0.1,
            0.2,
            0.3,
            "too far",
        ),
        GraspEvent(
            40,
            GraspCommand(GraspAction.RELEASE, "arm_a"),
            GraspStatus.REJECTED,
            nan,
            nan,
            nan,
            "holds nothing",
        ),
    ]
    for event in events:
        graph.say(GRASP_EVENT, event_message(event))
    graph.until(lambda: len(graph.monitor.progress.events) == 2, "the events")
    assert repr(graph.monitor.progress.events) == repr(events)


def test_every_event_has_been_heard_when_the_plant_says_so(graph: FakeGraph) -> None:
    """Messages of different topics arrive in any order: the counts of the end may come before the events."""
    monitor = graph.monitor
    assert not monitor.heard_every_event

    def tell(node: str, count: int) -> None:
        counts = PublishedCounts(node=node, topics=["/joint_states", f"/{GRASP_EVENT}"], counts=[7, count])
        graph.say(RUN_PUBLISHED, counts)

    tell("controller", 0)
    graph.say(GRASP_EVENT, GraspEventMessage())
    graph.until(lambda: monitor.progress.events, "the first event")
    assert not monitor.heard_every_event
    tell("plant", 2)
    graph.say(GRASP_EVENT, GraspEventMessage())
    graph.until(lambda: monitor.heard_every_event, "the second event and the counts")
    assert len(monitor.progress.events) == 2


def test_decisions_of_every_node_are_heard(graph: FakeGraph) -> None:
    monitor = graph.monitor
    events = [
        RunEvent(20, "plant", "command_lost", Severity.WARNING, "no command", value=0.2, limit=0.1, unit="s"),
        RunEvent(40, "trajectory", "phase_failed", Severity.ERROR, "out of reach", "carry"),
    ]
    for node, count in (("plant", 1), ("trajectory", 1)):
        counts = PublishedCounts(node=node, topics=[f"/space/{RUN_EVENTS}"], counts=[count])
        graph.say(RUN_PUBLISHED, counts)
    graph.say(RUN_EVENTS, run_event_message(events[0]))
    graph.until(lambda: monitor.progress.run_events, "the first event")
    assert not monitor.heard_every_event
    graph.say(RUN_EVENTS, run_event_message(events[1]))
    graph.until(lambda: monitor.heard_every_event, "the second event and the counts")
    assert repr(monitor.progress.run_events) == repr(events)


def test_what_strangers_say_of_a_run_is_not_believed(bench: Bench) -> None:
    """Neither that it is over, nor that a grasp has missed; nor what makes no sense, whoever says it."""
    graph = FakeGraph(bench, INPUTS[DIRECT])
    progress = graph.monitor.progress
    graph.state(RunState.RUNNING, 0)
    graph.until(lambda: progress.state == RunState.RUNNING, "the start")
    stranger, publishers = bench.plain("stranger"), list[Publisher]()
    lies = (
        (RUN_STATE, RunState(state=RunState.FINISHED)),
        (GRASP_EVENT, GraspEventMessage(status=GraspEventMessage.MISSED)),
        (RUN_PUBLISHED, PublishedCounts(node="plant", topics=["/task/grasp_event"], counts=[7])),
    )
    for topic, message in lies:
        publishers.append(stranger.create_publisher(type(message), topic, LATCHED))
        bench.until(lambda: publishers[-1].get_subscription_count() == 1, f"the match of {topic}")
        publishers[-1].publish(message)
    graph.say(GRASP_EVENT, GraspEventMessage(status=77))
    graph.say(GRASP_EVENT, GraspEventMessage())
    graph.say(RUN_PUBLISHED, PublishedCounts(node="plant", topics=["/task/grasp_event"], counts=[1]))
    graph.until(lambda: graph.monitor.heard_every_event, "the truth")
    assert (len(progress.events), progress.state) == (1, RunState.RUNNING)
    graph.destroy()


def test_a_run_without_events_has_none_to_wait_for(graph: FakeGraph) -> None:
    graph.say(RUN_PUBLISHED, PublishedCounts(node="plant", topics=["/joint_states"], counts=[7]))
    graph.until(lambda: graph.monitor.heard_every_event, "the counts")
    assert graph.monitor.progress.events == []


def test_tool_errors_are_distances_to_the_targets(graph: FakeGraph) -> None:
    error = graph.monitor.progress.tool_error
    target = position_stamped(1.0, 2.0, 3.0)
    tool = position_stamped(1.002, 1.997, 3.006)
    said = ((target_pose("arm_b"), target), (tool_pose("arm_b"), tool))
    graph.until(lambda: "arm_b" in error, "the tool", *said)
    assert error == {"arm_b": pytest.approx(0.007, rel=1e-12)}


def test_a_pose_without_a_target_is_no_error(graph: FakeGraph) -> None:
    said = ((tool_pose("arm_a"), PoseStamped()), (TASK_PHASE, TaskPhaseMessage(name="later")))
    graph.until(lambda: graph.monitor.progress.phase == "later", "a later message", *said)
    assert graph.monitor.progress.tool_error == {}


def test_who_waits_for_what_is_told(graph: FakeGraph) -> None:
    waiting = graph.monitor.progress.waiting
    assert graph.monitor.waiting_for() == "no node says why"
    warn = DiagnosticStatus(level=DiagnosticStatus.WARN, name="ik", message="waiting for x")
    graph.until(lambda: waiting, "the warning", (DIAGNOSTICS, DiagnosticArray(status=[warn])))
    assert graph.monitor.waiting_for() == "ik is waiting for x"
    fine = DiagnosticStatus(level=DiagnosticStatus.OK, name="ik")
    graph.until(lambda: not waiting, "the all-clear", (DIAGNOSTICS, DiagnosticArray(status=[fine])))


def test_the_plant_is_asked_to_finish(graph: FakeGraph) -> None:
    assert not graph.monitor.ask_to_finish()  # there is no service yet
    asked: list[Trigger.Request] = []

    def finish(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        asked.append(request)
        return response

    graph.node.create_service(Trigger, "~/finish", finish)

    graph.bench.until(graph.monitor.ask_to_finish, "the service")
    graph.bench.until(lambda: asked, "the request")
    assert len(asked) == 1


def test_late_listeners_hear_what_was_said(bench: Bench) -> None:
    bench.start()
    plant = bench.plain("plant")
    plant.create_publisher(RunState, RUN_STATE, LATCHED).publish(RunState(state=RunState.FINISHED))
    plant.create_publisher(GraspEventMessage, GRASP_EVENT, LATCHED).publish(GraspEventMessage())
    launcher = bench.plain("launcher")
    monitor = RunMonitor(launcher, ("arm_a",), ExecutorInputs(launcher))
    bench.until(lambda: monitor.finished and monitor.progress.events, "what was said before")
