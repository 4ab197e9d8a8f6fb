"""The trajectory node: what it refuses before a run, and what it does with the answers it gets."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
import yaml
from rclpy.node import Node
from sms_handover_interfaces.srv import SolveIK
from std_msgs.msg import String

from sms_handover.errors import GraphError, ScheduleError
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    IK,
    IK_STATUS,
    JOINT_REFERENCE,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_READY,
    RUN_STATE,
    SOLVE_IK,
    TASK_PHASE,
    target_pose,
)
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.simulation.parameters import TRANSPORTS
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .bench import Bench
from .graph import TOPICS, Graph, Messages
from .short_handover import short_handover

pytestmark = pytest.mark.ros


class FakeIk:
    """Answers every request alike, and says that it is ready."""

    def __init__(self, node: Node, peers: Sequence[str], *, valid: bool = True, status: int = 0) -> None:
        """Take the answer."""
        self._node, self._valid, self._status = node, valid, status
        self._endpoints = Endpoints(node, TOPICS, peers)
        self.requests: list[Any] = []
        self._ready = self._endpoints.publisher(RUN_READY)
        for unused in (DIAGNOSTICS, RUN_EVENTS, RUN_PUBLISHED):
            self._endpoints.publisher(unused)
        self._endpoints.subscribe(RUN_STATE, lambda message: None)
        node.create_service(SolveIK, SOLVE_IK, self._on_request)

    def get_ready(self, bench: Bench) -> None:
        """Wait for the other nodes, and say so."""
        bench.until(lambda: not self._endpoints.unmatched, "the endpoints of the graph")
        self._ready.publish(String(data=IK))

    def _on_request(self, request: Any, response: Any) -> Any:
        """Give the seed back in another order, or refuse."""
        self.requests.append(request)
        response.valid = self._valid
        response.message = "" if self._valid else "made up"
        response.solution.name = list(request.seed.name)[::-1]
        response.solution.position = list(request.seed.position)[::-1]
        response.status.header = request.seed.header
        response.status.status = self._status
        return response


def graph_with(bench: Bench, **answer: Any) -> Graph:
    """Return the graph with a made-up IK node, ready to run."""

    def fake(node: Node, peers: Sequence[str]) -> FakeIk:
        return FakeIk(node, peers, **answer)

    graph = Graph(bench, fakes={IK: fake})
    graph.fakes[IK].get_ready(bench)
    return graph


def test_a_refusal_of_the_ik_service_ends_the_run_in_words(bench: Bench) -> None:
    graph = graph_with(bench, valid=False)
    with pytest.raises(GraphError, match="the IK service rejected a request: made up"):
        graph.run()


def test_a_solution_that_has_not_converged_is_used_and_counted(bench: Bench) -> None:
    graph = graph_with(bench, status=2)
    graph.run()
    trajectory = graph.nodes["trajectory"]
    assert isinstance(trajectory, TrajectoryNode)
    told = trajectory.report().values
    assert told["ik_not_converged"] == told["references"] == len(graph.heard[JOINT_REFERENCE])
    assert {status.status for status in Messages().of(graph, IK_STATUS)} == {2}


def test_the_service_is_asked_with_the_state_it_is_about(bench: Bench) -> None:
    """The seed is the present joints, the base is where it is, and the answer is matched by name."""
    graph = graph_with(bench)
    graph.run()
    messages = Messages()
    states = messages.of(graph, "sampled_joint_states")
    bases = messages.of(graph, "sampled_base_odometry")
    references = messages.of(graph, JOINT_REFERENCE)
    requests = graph.fakes[IK].requests
    assert len(requests) == len(references) == len(states)
    for request, state, base, reference in zip(requests, states, bases, references, strict=True):
        assert (request.seed.header.stamp.sec, request.seed.header.stamp.nanosec) == (
            state.header.stamp.sec,
            state.header.stamp.nanosec,
        )
        assert request.base_in_world.position.x == base.pose.pose.position.x
        assert list(reference.position) == list(request.seed.position)
        assert list(request.seed.name) == list(state.name)
    assert list(requests[0].arms) == ["arm_a"]  # arm B holds its joints in the first phase


def test_a_state_that_comes_again_is_answered_with_all_that_belongs_to_it(bench: Bench) -> None:
    """Whoever has missed some of it, such as a controller that joined late, can go on."""
    graph = graph_with(bench)
    graph.run()
    topics = (TASK_PHASE, JOINT_REFERENCE, target_pose("arm_a"), target_pose("arm_b"))
    before = {topic: len(graph.heard[topic]) for topic in topics}
    graph.plant._outputs.publish_loop(graph.plant._plant, with_reference=True)
    bench.until(lambda: all(len(graph.heard[topic]) > before[topic] for topic in topics), "all of it again")
    for topic in topics:
        assert graph.heard[topic][-1] == graph.heard[topic][-2]


@pytest.mark.parametrize("answers", [0, 2])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_request_without_an_answer_is_repeated(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, transport: str, answers: int
) -> None:
    """The references are those of ever, also if it turns out that the first was answered after all."""
    graph = Graph(bench, {"plant": {"resend_after": 0.05}, "common": {"transport": transport}})
    trajectory = graph.nodes["trajectory"]
    assert isinstance(trajectory, TrajectoryNode)
    ask, asked = trajectory._solver.call, count()

    def ask_badly(request: Any) -> None:
        if next(asked) != 3:
            ask(request)
        elif answers:
            ask(request)
            trajectory._repeat_request(trajectory._stamp_ns)

    monkeypatch.setattr(trajectory, "_solver", replace(trajectory._solver, call=ask_badly))
    graph.run()
    schedule = {"common": {"schedule": str(bench.folder / "schedule.yaml")}}
    expected = simulate(load_scenario("colliding", schedule))
    heard = Messages().of(graph, JOINT_REFERENCE)
    found = dict(zip(graph.stamps(JOINT_REFERENCE), (message.position for message in heard), strict=True))
    assert list(found) == expected.reference_ns.tolist()
    np.testing.assert_array_equal(list(found.values()), expected.reference_position)


def with_schedule(bench: Bench, text: str, parameters: dict[str, dict[str, object]] | None = None) -> None:
    """Start ROS with a schedule."""
    path = bench.folder / "schedule.yaml"
    path.write_text(text, encoding="utf-8")
    bench.start({"common": {"schedule": str(path)}, **(parameters or {})})


def test_a_schedule_with_an_error_is_refused_with_its_line(bench: Bench) -> None:
    with_schedule(bench, short_handover().replace("grasp_frame: end_a", "grasp_frame: end_c", 1))
    with pytest.raises(ScheduleError, match=r"schedule.yaml:\d+: .*unknown grasp frame 'end_c'"):
        bench.add(TrajectoryNode)


@pytest.mark.parametrize("off", [0.02, 0.04])
def test_how_near_a_grasp_must_be_is_for_the_plant_to_say(bench: Bench, off: float) -> None:
    """A plant that is told to grasp from further away can be given a schedule that makes use of it."""
    schedule = yaml.safe_load(short_handover())
    aside = {"xyz": [0.0, 0.0, -off], "rpy": [0.0, 0.0, 0.0]}
    schedule["phases"][0]["arms"]["arm_a"]["tool_in_grasp_frame"] = aside
    tolerance: dict[str, object] = {"grasp_position_tolerance": 0.1, "grasp_speed_tolerance": 1.0}
    graph = Graph(bench, {"plant": tolerance}, schedule=yaml.safe_dump(schedule))
    graph.run()
    events = Messages().of(graph, "task/grasp_event")
    assert [event.status for event in events] == [0, 0]
    assert np.isfinite(events[0].position_error)
