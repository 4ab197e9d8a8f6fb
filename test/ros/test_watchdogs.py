"""What the nodes do when an input stops coming or a grasp misses, and that they say so on run/events."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import yaml
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import RunState
from std_srvs.srv import Trigger

from sms_handover.graph.events import (
    COMMAND_LOST,
    GRASP_FAILED,
    IK_FAILED,
    NO_ANSWER,
    PHASE_RETRIED,
    POSITION_EXCEEDED,
    RATE_EXCEEDED,
    REFERENCE_BACK,
    REFERENCE_LOST,
    TORQUE_ZERO,
    RunEvent,
)
from sms_handover.graph.topics import (
    CONTROLLER,
    IK,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    PLANT,
    RUN_EVENTS,
    RUN_STATE,
    TASK_PHASE,
    TRAJECTORY,
)
from sms_handover.messages.values import run_event, task_phase
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import JointReference, TaskPhase

from .bench import Bench
from .graph import TOPICS, Graph, Messages
from .short_handover import short_handover
from .test_controller_node import REFERENCE_NS, Rest, inputs
from .test_plant_peers import REALTIME, TICK_NS, FastClock, efforts, plant_with, run_until
from .test_trajectory_node import FakeIk

pytestmark = pytest.mark.ros


def events(graph: Graph) -> list[RunEvent]:
    return [run_event(message) for message in Messages().of(graph, RUN_EVENTS)]


def last_state(graph: Graph) -> tuple[int, str]:
    message = Messages().of(graph, RUN_STATE)[-1]
    return message.state, message.detail


# The task: the same decisions over DDS in lock step as in one process


def missing_grasp(on_miss: object) -> str:
    """Return a schedule whose first grasp misses, with what its phase does about it."""
    schedule = yaml.safe_load(short_handover(deputy_off=(0.02, 0.0, 0.0)))
    schedule["phases"][1]["on_miss"] = on_miss
    return str(yaml.safe_dump(schedule, sort_keys=False))


@pytest.mark.parametrize(("on_miss", "kinds"), [("abort", []), ({"retry": 2}, [PHASE_RETRIED] * 2)])
def test_a_missed_grasp_leads_to_the_same_over_dds(bench: Bench, on_miss: object, kinds: list[str]) -> None:
    graph = Graph(bench, {TRAJECTORY: {"failure_hold": 0.04}}, schedule=missing_grasp(on_miss))
    graph.run()
    expected = simulated(bench, failure_hold=0.04)
    assert [event.kind for event in expected.run_events] == [*kinds, GRASP_FAILED]
    assert repr(events(graph)) == repr(list(expected.run_events))
    assert [task_phase(message) for message in Messages().of(graph, TASK_PHASE)] == list(expected.phases)
    assert graph.stamps(JOINT_STATES) == expected.tick_ns.tolist()
    assert np.array(efforts(graph)).tobytes() == expected.joint_effort.tobytes()
    assert last_state(graph) == (RunState.FAILED, "phase 'carry' has failed")


def simulated(bench: Bench, **trajectory: object) -> RunData:
    common = {"schedule": str(bench.folder / "schedule.yaml")}
    return simulate(load_scenario("colliding", {"common": common, TRAJECTORY: trajectory}))


def test_enforced_limits_lead_to_the_same_over_dds(bench: Bench) -> None:
    """In bits and in events: one joint runs up its torque-speed line, another is dragged into a stop."""
    limits = "{joint_5: {position: [-1.459, -1.458]}, joint_7: {position: [-6.0, -1.53]}}"  # [rad]
    given: dict[str, dict[str, Any]] = {"controller": {"law": "pid"}, PLANT: {"joint_limits": "enforce"}}
    common: dict[str, Any] = {"values": (f"robot.arms.arm_b.limits:={limits}",)}
    graph = Graph(bench, {**given, "common": common})
    graph.run()
    common["schedule"] = str(bench.folder / "schedule.yaml")
    expected = simulate(load_scenario("colliding", {**given, "common": common}))
    assert {event.kind for event in expected.run_events} == {POSITION_EXCEEDED, RATE_EXCEEDED}
    assert repr(events(graph)) == repr(list(expected.run_events))
    assert np.max(np.abs(expected.joint_effort[1:] - expected.joint_command[:-1])) > 0.01  # [N m] by the line
    states = list(Messages().of(graph, JOINT_STATES))
    for name in ("position", "velocity", "effort"):
        rows = np.array([getattr(state, name) for state in states])
        assert rows.tobytes() == getattr(expected, f"joint_{name}").tobytes()


def test_a_second_run_decides_the_same(bench: Bench) -> None:
    """Retries that were used up before a reset are there again after it."""
    schedule = missing_grasp({"retry": 1})
    graph = Graph(bench, {TRAJECTORY: {"failure_hold": 0.04}}, schedule=schedule)
    graph.run()
    first = events(graph)
    assert [event.kind for event in first] == [PHASE_RETRIED, GRASP_FAILED]
    assert graph.call("reset", Trigger).success
    bench.until(lambda: len(graph.heard[RUN_EVENTS]) == 4, "the events of the second run")
    graph.wait_for_end()
    assert repr(events(graph)) == repr(first * 2)


def test_solves_that_never_converge_end_the_run_as_failed(bench: Bench) -> None:
    def fake(node: Any, peers: Sequence[str]) -> FakeIk:
        return FakeIk(node, peers, status=1)

    graph = Graph(bench, {TRAJECTORY: {"ik_failures": 3, "failure_hold": 0.02}}, fakes={IK: fake})
    graph.fakes[IK].get_ready(bench)
    graph.run()
    (event,) = events(graph)
    assert (event.kind, event.stamp_ns, event.value) == (IK_FAILED, 60_000_000, 3.0)
    assert last_state(graph) == (RunState.FAILED, "phase 'approach' has failed")
    assert graph.stamps(JOINT_STATES)[-1] == 80_000_000
    held = [list(m.position) for m in Messages().of(graph, JOINT_REFERENCE) if stamp_of(m) >= 60_000_000]
    at_failure = list(Messages().of(graph, JOINT_STATES)[60].position)
    assert held == [at_failure] * 2


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


# No command


@pytest.fixture
def fast_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sms_handover.ros.transport.loop_clock.monotonic", FastClock())


def test_in_real_time_the_torque_is_held_and_then_ramped_to_zero(bench: Bench, fast_clock: None) -> None:
    """One command, for the first state, and then none: what is applied is the closed form, bit for bit."""
    limits = {"command_hold": 0.05, "command_ramp": 0.1, "catch_up": 3600.0}  # s; the fast clock lags
    graph = plant_with(bench, common=REALTIME, plant=limits, duration=0.2, silent=True)
    push = np.linspace(-0.001, 0.002, 14)  # N m, by which no joint gets too fast
    command = JointState(name=list(graph.plant.robot.joint_names), effort=push.tolist())
    graph.fakes[CONTROLLER]._command.publish(command)
    bench.until(lambda: np.any(graph.plant._command.effort), "the command")
    graph.ear.get_ready(bench)
    run_until(graph, lambda: graph.plant.finished and graph.everything_heard())
    shares = [min(1.0, max(0.0, (150 - k) / 100)) for k in range(200)]  # of the tick that begins at k ms
    np.testing.assert_allclose(efforts(graph)[1:], np.outer(shares, push), rtol=1e-12, atol=0.0)
    assert [(event.kind, event.stamp_ns) for event in events(graph)] == [
        (COMMAND_LOST, 51 * TICK_NS),
        (TORQUE_ZERO, 150 * TICK_NS),
    ]


def test_in_lock_step_a_run_without_an_answer_ends_as_failed(bench: Bench) -> None:
    graph = plant_with(bench, plant={"answer_timeout": 0.2}, silent=True)
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.finished, "the end of the run")
    bench.until(graph.everything_heard, "all messages")
    (event,) = events(graph)
    assert (event.kind, event.stamp_ns, event.limit) == (NO_ANSWER, 0, 0.2)
    assert event.value >= 0.2
    state, detail = last_state(graph)
    assert state == RunState.FAILED
    assert f"nothing has come on {JOINT_COMMAND} for the state of 0 s" in detail


# No reference


def test_in_real_time_a_controller_without_references_says_so(bench: Bench) -> None:
    """States go on for 0.3 s; one reference at the start, and one at 0.2 s."""
    rest = Rest(bench, mode="realtime", reference_hold=0.1)
    heard: list[Any] = []
    ear = Endpoints(bench.plain("ear"), TOPICS, ())
    ear.subscribe(RUN_EVENTS, lambda message: heard.append(run_event(message)))
    state, reference, phase = inputs(rest, 0, 0)
    first = rest.messages(state, reference, phase)
    rest.send(first, TASK_PHASE, JOINT_REFERENCE)
    bench.until(lambda: rest.node._parts.complete, "the guidance")
    for number in range(16):
        stamp = number * REFERENCE_NS
        now, _, _ = inputs(rest, stamp, number)
        if number == 10:
            second = JointReference(stamp, reference.position, reference.velocity)
            again = TaskPhase(stamp, phase.index, phase.name)
            rest.send(rest.messages(now, second, again), TASK_PHASE, JOINT_REFERENCE)
            bench.until(lambda: rest.node._parts.reference_ns > 0, "the second reference")
        rest.send(rest.messages(now, reference, phase), JOINT_STATES, "base_odometry")
        rest.wait_for(number + 1)
    bench.until(lambda: len(heard) == 2, "both events")
    assert [(event.kind, event.stamp_ns, event.node) for event in heard] == [
        (REFERENCE_LOST, 7 * REFERENCE_NS, CONTROLLER),  # 0.14 s, the first state beyond 0.02 + 0.1 s
        (REFERENCE_BACK, 10 * REFERENCE_NS, CONTROLLER),
    ]
