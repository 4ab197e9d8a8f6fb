"""The lifecycle of the nodes: transitions by services as `ros2 lifecycle` asks for them, right and wrong."""

import gc
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    IK,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    LOOP_NODES,
    PLANT,
    RECORDER,
    RUN_STATE,
    TASK_PHASE,
    TRAJECTORY,
)
from sms_handover.launcher import lifecycle_driver
from sms_handover.launcher.lifecycle_driver import LifecycleDriver
from sms_handover.messages.stamps import stamp_ns
from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.recorder import RecorderNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.simulation.parameters import DIRECT, EXECUTOR

from .bench import Bench
from .graph import REAL, Graph, Messages

pytestmark = pytest.mark.ros

TICK_NS = 1_000_000  # ns
NODES: dict[str, Callable[[], GraphNode[Any]]] = {
    PLANT: PlantNode,
    TRAJECTORY: TrajectoryNode,
    IK: IkNode,
    CONTROLLER: ControllerNode,
    RECORDER: RecorderNode,
}
CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
REGULAR = (JOINT_STATES, BASE_ODOMETRY, JOINT_COMMAND, JOINT_REFERENCE, TASK_PHASE)
MANAGED = {"common": {"autostart": False}}


class Tool:
    """Asks a node for transitions, as `ros2 lifecycle` does."""

    def __init__(self, bench: Bench, name: str) -> None:
        """Prepare to ask the node of a name."""
        self._bench, self._name = bench, name
        self._node = bench.plain(f"tool_of_{name}")
        self._clients: dict[str, Any] = {}  # each is found once, which takes the middleware a while

    def call(self, service: str, kind: Any, **values: Any) -> Any:
        """Return the answer of one of its services."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, f"{self._name}/{service}")
        client = self._clients[service]
        self._bench.until(client.service_is_ready, f"the service {self._name}/{service}")
        return self._bench.result(
            client.call_async(kind.Request(**values)), f"an answer of {self._name}/{service}"
        )

    def change(self, transition: int) -> bool:
        """Ask for a transition and tell whether it was made."""
        return bool(self.call("change_state", ChangeState, transition=Transition(id=transition)).success)

    @property
    def state(self) -> str:
        """Return the state that the node says it is in."""
        return str(self.call("get_state", GetState).current_state.label)


def entities(node: Node) -> list[int]:
    """Return how many of each kind a node has."""
    kinds = (node.publishers, node.subscriptions, node.clients, node.services, node.timers)
    return [len(list(kind)) for kind in kinds]


@pytest.fixture(params=list(NODES))
def name(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)  # where the recorder puts its bag
    return str(request.param)


def test_every_transition_of_every_node(bench: Bench, name: str) -> None:
    """Through all states twice, as a node that is configured again must be as good as new."""
    bench.start({**MANAGED, "recorder": {"folder": "bag"}})
    node = bench.add(NODES[name])
    tool = Tool(bench, name)
    events: list[str] = []
    listener = bench.plain("listener")

    def tell(event: Any) -> None:
        events.append(event.goal_state.label)

    listener.create_subscription(TransitionEvent, f"{name}/transition_event", tell, 100)
    bench.until(lambda: listener.count_publishers(f"/{name}/transition_event"), "the events")
    before = entities(node)
    for round_ in range(2):
        assert tool.state == "unconfigured"
        for transition, state in (
            (CONFIGURE, "inactive"),
            (ACTIVATE, "active"),
            (DEACTIVATE, "inactive"),
            (ACTIVATE, "active"),
            (DEACTIVATE, "inactive"),
            (CLEANUP, "unconfigured"),
        ):
            if name == RECORDER and round_ and transition == CONFIGURE:
                Path("bag").rename("first")
            assert tool.change(transition), state
            assert tool.state == state
    assert entities(node) == before
    assert tool.change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    bench.until(lambda: events and events[-1] == "finalized", "the last event")
    assert [label for label in events if label == "active"] == ["active"] * 4
    assert node.finalized


@pytest.mark.parametrize("way", [(), (CONFIGURE,), (CONFIGURE, ACTIVATE)])
def test_a_transition_that_a_state_does_not_have_is_refused(bench: Bench, way: tuple[int, ...]) -> None:
    """And nothing comes of it: the node stays where it was and takes the right one."""
    bench.start(MANAGED)
    node = bench.add(IkNode)
    tool = Tool(bench, IK)
    assert all(tool.change(transition) for transition in way)
    there = tool.call("get_available_transitions", GetAvailableTransitions).available_transitions
    possible = {description.transition.id for description in there}
    state = tool.state
    wrong = {CONFIGURE, ACTIVATE, DEACTIVATE, CLEANUP, 99} - possible
    assert wrong
    for transition in wrong:
        assert not tool.change(transition)
    assert not tool.call("change_state", ChangeState, transition=Transition(label="no such")).success
    assert tool.state == state
    shutdown = max(id_ for id_ in possible if id_ < State.TRANSITION_STATE_CONFIGURING)
    assert tool.change(shutdown)
    assert node.finalized


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"common": {"schedule": "no.yaml"}}, "cannot read the schedule no.yaml"),
        ({"common": {"robot": "no.yaml"}}, "no.yaml"),
        ({"common": {"tick": -1.0}}, "parameter 'tick' is -1.0 s"),
        ({"controller": {"law": "pdi"}}, "did you mean 'pid'"),
        ({"controller": {"law": "pid", "derivative": 50.0}}, "unstable"),
    ],
)
def test_an_error_in_a_transition_ends_the_node_with_its_reason(
    bench: Bench, parameters: dict[str, dict[str, object]], text: str
) -> None:
    common = {**parameters.get("common", {}), "autostart": False}
    bench.start({**parameters, "common": common})
    node: ControllerNode = bench.later(ControllerNode)
    assert node.state_name == "unconfigured"
    node.trigger_configure()
    assert node.finalized
    stop: Any = lambda: None  # noqa: E731
    with pytest.raises(ConfigurationError, match=text):
        node.should_run(stop)


def test_a_node_that_is_destroyed_has_left_the_graph(bench: Bench, name: str) -> None:
    """At once, with all threads of the middleware, as a node does that is not managed."""
    threads = []
    gc.collect()  # what tests before this one have left
    gc.disable()
    try:
        for make in (lambda: Node(name, start_parameter_services=False), NODES[name]):
            bench.start({**MANAGED, "recorder": {"folder": "bag"}})
            node = bench.add(make)
            if isinstance(node, GraphNode):
                node.trigger_configure()
            del node
            bench.close()
            threads.append(len(os.listdir("/proc/self/task")))
    finally:
        gc.enable()
    assert threads[1] == threads[0]


# The run


def managed(bench: Bench, law: str = "pid", transport: str = "direct", mode: str = "lockstep") -> Graph:
    """Return the graph, unconfigured."""
    common = {"autostart": False, "transport": transport, "mode": mode}
    return Graph(bench, {"common": common, "controller": {"law": law}})


def drive(graph: Graph) -> None:
    """Take every node to the state ``active``, and the ear of the graph with them."""
    driver = LifecycleDriver(graph.client, LOOP_NODES)

    def active() -> bool:
        driver.look()
        return driver.active

    graph.bench.until(active, "every node to be active")
    assert driver.waiting_for == ""
    graph.ear.get_ready(graph.bench)


@pytest.mark.parametrize("lost", ["request", "answer"])
def test_a_node_that_is_silent_is_asked_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    """The middleware loses the first answer of a service if its node has not found who asks soon enough."""
    monkeypatch.setattr(lifecycle_driver, "_SILENCE_S", 0.05)
    bench.start(MANAGED)
    node = bench.add(IkNode)
    driver = LifecycleDriver(bench.plain("launcher"), [IK])
    client = driver._clients[IK]
    ask: Callable[[Any], Any] = client.call_async

    def lose(request: Any) -> Future:
        monkeypatch.setattr(client, "call_async", ask)
        if lost == "answer":
            ask(request)
        return Future()

    monkeypatch.setattr(client, "call_async", lose)

    def active() -> bool:
        driver.look()
        return driver.active

    bench.until(active, "the node to be active")
    assert node.state_name == "active"


def wait_for_tick(graph: Graph, tick: int) -> None:
    graph.bench.until(lambda: graph.plant.report().stamp_ns >= tick * TICK_NS, f"tick {tick}")


def test_nobody_says_anything_of_a_run_before_it_is_active(bench: Bench) -> None:
    graph = managed(bench)
    tools = {name: Tool(bench, name) for name in LOOP_NODES}
    for tool in tools.values():
        assert tool.change(CONFIGURE)
    for name in (TRAJECTORY, IK, CONTROLLER):
        assert tools[name].change(ACTIVATE)
    graph.ear.get_ready(bench)
    bench.until(lambda: len(graph.heard["run/ready"]) == 4, "all others")
    assert tools[PLANT].state == "inactive"
    assert not any(graph.heard[topic] for topic in (*REGULAR, RUN_STATE))
    assert tools[PLANT].change(ACTIVATE)
    graph.wait_for_end()
    assert len(graph.heard[JOINT_STATES]) == 341


@pytest.mark.parametrize(
    ("inactive", "transport"),
    [*((name, DIRECT) for name in LOOP_NODES), (PLANT, EXECUTOR), (TRAJECTORY, EXECUTOR)],
)
def test_a_deactivated_node_holds_the_run_at_a_tick_and_loses_nothing(
    bench: Bench, inactive: str, transport: str
) -> None:
    """The run is the same bit for bit; the inverse kinematics goes on answering, as it publishes nothing."""
    graph = managed(bench, transport=transport)
    drive(graph)
    graph.wait_for_end()
    messages = Messages()
    whole = {topic: messages.last_run(graph, topic) for topic in REGULAR}
    assert graph.call("reset", Trigger).success
    tool = Tool(bench, inactive)
    for tick in (33, 150):
        wait_for_tick(graph, tick)
        assert tool.change(DEACTIVATE)
        published = graph.nodes[inactive].endpoints.counts
        if inactive != IK:
            for _ in range(5):  # a graph that could go on would do many ticks meanwhile
                assert tool.state == "inactive"
            now = graph.nodes[inactive].endpoints.counts
            of_run = [topic for topic in now if topic.lstrip("/") in REGULAR]
            assert {topic: now[topic] for topic in of_run} == {topic: published[topic] for topic in of_run}
        assert tool.change(ACTIVATE)
    graph.wait_for_end()
    for topic in REGULAR:
        assert messages.last_run(graph, topic) == whole[topic], topic


def test_a_deactivated_plant_says_that_the_run_is_paused(bench: Bench) -> None:
    graph = managed(bench)
    drive(graph)
    tool = Tool(bench, PLANT)
    wait_for_tick(graph, 20)
    assert tool.change(DEACTIVATE)
    assert graph.call("pause", SetBool, data=True).success  # services answer; the pause outlasts activation
    assert tool.change(ACTIVATE)
    assert tool.change(DEACTIVATE)
    assert graph.call("pause", SetBool, data=False).success
    at = graph.plant.report().stamp_ns
    assert tool.change(ACTIVATE)
    graph.wait_for_end()
    details = [state.detail for state in Messages().of(graph, RUN_STATE)]
    assert details == ["", "deactivated", "activated", "run complete"]
    assert graph.stamps(JOINT_STATES) == sorted(set(graph.stamps(JOINT_STATES))) and at > 0


def test_a_node_that_is_shut_down_has_ended_its_part(bench: Bench) -> None:
    """The plant ends the run, so that nobody waits for it, and every node tells its counts."""
    graph = managed(bench)
    drive(graph)
    wait_for_tick(graph, 50)
    assert Tool(bench, PLANT).change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    bench.until(lambda: len(graph.heard["run/published"]) == 4, "the counts of every node")
    last = Messages().of(graph, RUN_STATE)[-1]
    assert (last.state, last.detail) == (last.FINISHED, "the plant was cleaned up")
    assert graph.plant.finalized


def test_a_node_that_is_configured_anew_begins_a_new_run(bench: Bench) -> None:
    """The plant alone is cleaned up and configured: the others get ready for another run, the same again."""
    graph = managed(bench)
    drive(graph)
    graph.wait_for_end()
    messages = Messages()
    whole = {topic: messages.last_run(graph, topic) for topic in REGULAR}
    tool = Tool(bench, PLANT)
    for transition in (DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE):
        assert tool.change(transition)
    bench.until(lambda: graph.plant.runs == 2 and graph.plant.finished, "the end of the second run")
    bench.until(graph.everything_heard, "all messages")
    for topic in REGULAR:
        assert messages.last_run(graph, topic) == whole[topic], topic
    assert stamp_ns(graph.heard[JOINT_STATES][-1]) == 340 * TICK_NS
    assert [type(node) for node in graph.nodes.values()] == [REAL[name] for name in graph.nodes]
