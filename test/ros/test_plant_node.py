"""The plant node in lock step with the real nodes in one process: run, pause, step, reset, finish."""

from collections.abc import Callable

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from sms_handover_interfaces.msg import GraspEvent, RunState
from sms_handover_interfaces.srv import StepTicks
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker

from sms_handover.errors import Reason
from sms_handover.frames import BASE, DEPUTY, WORLD
from sms_handover.graph.topics import (
    APPLIED_BASE_WRENCH,
    BASE_ODOMETRY,
    BASE_WRENCH,
    CLOCK,
    DEPUTY_MARKER,
    DEPUTY_POSE,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    LINEAR_IMPULSE,
    ROBOT_DESCRIPTION,
    RUN_PUBLISHED,
    RUN_READY,
    RUN_STATE,
    TASK_PHASE,
    TF,
    Rate,
)
from sms_handover.messages.values import base_wrench, header_ns, time_ns, vector_values
from sms_handover.ros.codecs.base_wrench import wrench_message
from sms_handover.ros.codecs.loop_messages import StateCodec
from sms_handover.ros.qos import LOSSLESS
from sms_handover.simulation.parameters import TRANSPORTS
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import BASE_NQ, BaseWrench

from .bench import Bench
from .graph import TOPICS, Graph, Messages
from .short_handover import APPROACH_S, CARRY_S, END_S, short_handover

pytestmark = pytest.mark.ros

TICK_NS = 1_000_000
REFERENCE_NS = 20_000_000
END_NS = round(END_S * 1e9)
TICKS = END_NS // TICK_NS + 1  # the state at the end is published and answered too
REGULAR = [  # a stamp each; of tf every publisher has one
    topic.name
    for topic in TOPICS
    if topic.rate in (Rate.TICK, Rate.REFERENCE, Rate.CLOCK) and topic.name != TF
]


@pytest.fixture
def graph(bench: Bench) -> Graph:
    return Graph(bench)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_every_stamp_comes_once_and_in_order(bench: Bench, transport: str) -> None:
    graph = Graph(bench, {"common": {"transport": transport}})
    graph.run()
    ticks = [k * TICK_NS for k in range(TICKS)]
    for topic in TOPICS:
        if topic.rate is Rate.TICK:
            assert graph.stamps(topic.name) == ticks, topic.name
        if topic.rate is Rate.REFERENCE:
            stamps = sorted(graph.stamps(topic.name))[:: len(topic.publishers)]
            assert stamps == ticks[:: REFERENCE_NS // TICK_NS], topic.name
    assert graph.stamps(CLOCK) == ticks[::10]
    states = Messages().of(graph, RUN_STATE)
    assert [(state.state, state.tick) for state in states] == [
        (RunState.RUNNING, 0),
        (RunState.FINISHED, TICKS - 1),
    ]
    assert states[-1].detail == "run complete"


def test_every_node_tells_how_much_it_has_published(graph: Graph) -> None:
    graph.run()
    graph.bench.until(lambda: len(graph.heard[RUN_PUBLISHED]) == 4, "the counts")
    told: dict[str, int] = {}
    for message in Messages().of(graph, RUN_PUBLISHED):
        for name, count in zip(message.topics, message.counts, strict=True):
            told[name] = told.get(name, 0) + int(count)
    for topic in TOPICS:
        of_run = topic.rate is not Rate.WALL and topic.name not in (RUN_PUBLISHED, RUN_READY)
        if of_run and not topic.is_from_outside:
            name = topic.name if topic.name.startswith("/") else f"/{topic.name}"
            assert told[name] == len(graph.heard[topic.name]), topic.name


def test_a_wrench_acts_over_the_tick_of_its_stamp_and_is_recorded(graph: Graph) -> None:
    """To the bit as in one process; what is late, beyond the end or in an unknown frame is counted."""
    asked = [
        BaseWrench(5 * TICK_NS + 1, WORLD, (40.0, 0.0, 0.0), (0.0, 3.0, 0.0)),
        BaseWrench(7 * TICK_NS, BASE, (0.0, -20.0, 5.0), (1.0, 0.0, 0.0)),
    ]
    bad = [
        BaseWrench(7 * TICK_NS + 5, WORLD, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        BaseWrench(END_NS, WORLD, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        BaseWrench(9 * TICK_NS, "tool", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ]
    publisher = graph.client.create_publisher(WrenchStamped, BASE_WRENCH, LOSSLESS)
    graph.bench.until(lambda: publisher.get_subscription_count() == 2, "plant and ear")
    for wrench in (*asked, *bad):
        publisher.publish(wrench_message(wrench))
    refused = graph.plant.message_filter
    graph.bench.until(lambda: sum(refused.counts.values()) == len(bad), "what is rejected")
    reasons = (Reason.DUPLICATE, Reason.FUTURE, Reason.FRAME)
    assert all(any(reason.value in name for name in refused.counts) for reason in reasons)
    graph.run()
    publisher.publish(wrench_message(BaseWrench(0, WORLD, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))))
    graph.bench.until(lambda: sum(refused.counts.values()) == len(bad) + 1, "what is late")
    applied = [base_wrench(message) for message in Messages().of(graph, APPLIED_BASE_WRENCH)]
    assert [wrench.stamp_ns // TICK_NS for wrench in applied] == [5, 7]
    common = {"scenario": "colliding", "schedule": str(graph.bench.folder / "schedule.yaml")}
    run = simulate(load_scenario(values={"common": common}), base_wrenches=applied)
    assert run.base_wrenches == tuple(applied)
    codec = StateCodec(graph.plant.robot.joint_names, WORLD, BASE)
    last = codec.read(graph.heard[JOINT_STATES][-1], graph.heard[BASE_ODOMETRY][-1])
    assert last.joint_position.tobytes() == run.joint_position[-1].tobytes()
    assert last.q[:BASE_NQ].tobytes() == run.base_pose[-1].tobytes()
    impulses = [vector_values(message) for message in Messages().of(graph, LINEAR_IMPULSE)]
    assert np.array(impulses) == pytest.approx(run.linear_impulse[1:], abs=0.0)
    assert run.linear_momentum[-1] == pytest.approx(run.linear_impulse[-1], abs=1e-12)
    assert abs(run.linear_impulse[-1][0]) > 0.03


def test_deputy_changes_hands(graph: Graph) -> None:
    graph.run()
    events = Messages().of(graph, GRASP_EVENT)
    assert [event.status for event in events] == [GraspEvent.SUCCEEDED] * 2
    assert [header_ns(event) for event in events] == [
        round(APPROACH_S * 1e9),
        round((APPROACH_S + CARRY_S) * 1e9),
    ]
    assert events[1].detail == "arm_b holds the deputy"
    assert graph.plant.report().values["holder"] == "arm_b"


def test_robot_description_comes_before_the_run(graph: Graph) -> None:
    """Also if all others are ready before the plant looks whether its endpoints have matched."""
    look = graph.plant.membership.matching
    look.timer_period_ns = 500_000_000  # ns
    look.reset()
    graph.run()
    assert len(graph.heard[ROBOT_DESCRIPTION]) == 1


def test_robot_description_is_there_for_late_comers(graph: Graph) -> None:
    graph.run()
    (message,) = Messages().of(graph, ROBOT_DESCRIPTION)
    assert message.data == graph.plant.robot.urdf


def test_the_deputy_is_a_box_that_stays_with_its_frame(graph: Graph) -> None:
    graph.run()
    (marker,) = Messages().of(graph, DEPUTY_MARKER)
    assert (marker.type, marker.action, marker.frame_locked) == (Marker.CUBE, Marker.ADD, True)
    assert marker.header.frame_id == DEPUTY
    assert [marker.scale.x, marker.scale.y, marker.scale.z] == [0.1, 0.34, 0.1]
    assert marker.color.a == 1.0 and marker.pose.orientation.w == 1.0
    assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 0)


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_the_transport_changes_no_bit(bench: Bench, law: str) -> None:
    heard: dict[str, list[list[bytes]]] = {name: [] for name in (*REGULAR, GRASP_EVENT)}
    for transport in TRANSPORTS:
        graph = Graph(bench, {"common": {"transport": transport}, "controller": {"law": law}})
        graph.run()
        for name, runs in heard.items():
            runs.append(Messages().last_run(graph, name))
        bench.close()
    for name, (direct, by_executor) in heard.items():
        assert direct and direct == by_executor, name


# Reset


def wait_for_tick(graph: Graph, tick: int) -> None:
    graph.bench.until(lambda: graph.plant.report().stamp_ns >= tick * TICK_NS, f"tick {tick}")


def reset(graph: Graph) -> None:
    assert graph.call("reset", Trigger).success


def pause(graph: Graph, on: bool) -> bool:
    return bool(graph.call("pause", SetBool, data=on).success)


def after_the_end(graph: Graph) -> None:
    graph.wait_for_end()
    reset(graph)


def while_running(graph: Graph) -> None:
    wait_for_tick(graph, 100)
    reset(graph)


def twice(graph: Graph) -> None:
    wait_for_tick(graph, 10)
    reset(graph)
    reset(graph)


def while_paused(graph: Graph) -> None:
    wait_for_tick(graph, 100)
    pause(graph, True)
    reset(graph)
    pause(graph, False)


def while_stepping(graph: Graph) -> None:
    wait_for_tick(graph, 100)
    pause(graph, True)
    graph.call("step", StepTicks, ticks=300)
    reset(graph)
    pause(graph, False)


def after_finish_on_request(graph: Graph) -> None:
    wait_for_tick(graph, 150)
    graph.call("finish", Trigger)
    reset(graph)


@pytest.mark.parametrize(
    ("law", "disturb"),
    [
        ("nmpc", after_the_end),
        ("nmpc", while_running),
        ("pid", after_the_end),
        ("pid", while_running),
        ("pid", twice),
        ("pid", while_paused),
        ("pid", while_stepping),
        ("pid", after_finish_on_request),
    ],
)
def test_a_reset_run_has_the_same_bits(bench: Bench, law: str, disturb: Callable[[Graph], None]) -> None:
    graph = Graph(bench, {"controller": {"law": law}})
    graph.run()
    messages = Messages()
    first = {name: messages.last_run(graph, name) for name in (*REGULAR, GRASP_EVENT)}
    assert len(first[JOINT_STATES]) == TICKS
    reset(graph)
    disturb(graph)
    graph.wait_for_end()
    for name in REGULAR:
        assert messages.last_run(graph, name) == first[name], name
    assert messages.last_run(graph, GRASP_EVENT)[-2:] == first[GRASP_EVENT]


# Pause and step


def wait_for_commands(graph: Graph, count: int) -> None:
    """Wait until that many states have been answered; a paused plant would go on now if it could."""
    graph.bench.until(lambda: len(graph.heard[JOINT_COMMAND]) >= count, f"{count} commands")


def test_steps_are_counted_exactly(graph: Graph) -> None:
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 30)
    assert pause(graph, True)
    at = graph.plant.report().stamp_ns
    for ticks in (1, 1, 7, 45):
        answer = graph.call("step", StepTicks, ticks=ticks)
        assert answer.success
        at += ticks * TICK_NS
        assert time_ns(answer.stamp) == at
        wait_for_commands(graph, at // TICK_NS + 1)
        last = Messages().of(graph, RUN_STATE)[-1]
        assert (last.state, last.tick, header_ns(last)) == (RunState.PAUSED, at // TICK_NS, at)
        assert graph.plant.report().stamp_ns == at
        assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(at // TICK_NS + 1)]
    assert pause(graph, False)
    graph.wait_for_end()
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(TICKS)]


def test_a_pause_changes_no_bit(bench: Bench) -> None:
    graph = Graph(bench)
    graph.run()
    messages = Messages()
    first = {name: messages.last_run(graph, name) for name in REGULAR}
    reset(graph)
    for tick in (50, 51, 200, 300):
        wait_for_tick(graph, tick)
        pause(graph, True)
        graph.call("step", StepTicks, ticks=3)
        pause(graph, False)
    graph.wait_for_end()
    for name in REGULAR:
        assert messages.last_run(graph, name) == first[name], name


def test_steps_end_with_the_run(graph: Graph) -> None:
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 20)
    pause(graph, True)
    answer = graph.call("step", StepTicks, ticks=2**32 - 1)
    assert answer.success and time_ns(answer.stamp) == END_NS
    answer = graph.call("step", StepTicks, ticks=1)
    assert not answer.success and "the last tick has been reached" in answer.message
    graph.bench.until(lambda: graph.plant.report().stamp_ns == END_NS, "the last tick")
    pause(graph, False)
    graph.wait_for_end()
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(TICKS)]


def test_a_reset_ends_the_steps(graph: Graph) -> None:
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 50)
    pause(graph, True)
    graph.call("step", StepTicks, ticks=200)
    reset(graph)
    graph.bench.until(lambda: graph.plant.report().stamp_ns == 0, "the reset")
    answered = len(graph.heard[JOINT_STATES])
    wait_for_commands(graph, answered + 1)
    assert graph.call("step", StepTicks, ticks=1).success
    wait_for_commands(graph, answered + 2)
    states = Messages().of(graph, RUN_STATE)[-2:]
    assert [(state.state, state.tick, state.detail) for state in states] == [
        (RunState.PAUSED, 0, "reset"),
        (RunState.PAUSED, 1, "stepped"),
    ]
    assert graph.stamps(JOINT_STATES)[-2:] == [0, TICK_NS]


def test_what_makes_no_sense_is_refused(graph: Graph) -> None:
    """Before the run, while it runs, and after it."""
    answer = graph.call("step", StepTicks, ticks=1)
    assert not answer.success and "pause" in answer.message
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 0)
    assert not graph.call("step", StepTicks, ticks=1).success  # it runs
    assert pause(graph, True)
    assert not graph.call("step", StepTicks, ticks=0).success
    assert pause(graph, False)
    assert graph.call("finish", Trigger).success
    assert not graph.call("finish", Trigger).success
    assert not pause(graph, True)
    assert not graph.call("step", StepTicks, ticks=1).success


def test_finish_ends_the_run_at_once(graph: Graph) -> None:
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 100)
    assert graph.call("finish", Trigger).success
    graph.wait_for_end()
    stamps = graph.stamps(JOINT_STATES)
    assert 100 < len(stamps) < TICKS
    assert stamps == [k * TICK_NS for k in range(len(stamps))]
    graph.bench.until(lambda: len(graph.heard[RUN_PUBLISHED]) == 4, "the counts of every node")
    last = Messages().of(graph, RUN_STATE)[-1]
    assert (last.state, last.detail) == (RunState.FINISHED, "stopped on request")
    assert header_ns(last) == stamps[-1]


# What the plant reports


def test_a_missed_grasp_is_reported_and_the_deputy_stays(bench: Bench) -> None:
    graph = Graph(bench, schedule=short_handover(deputy_off=(0.0, 0.03, 0.04)))
    graph.run()
    messages = Messages()
    grasp, transfer = messages.of(graph, GRASP_EVENT)
    assert grasp.status == GraspEvent.MISSED
    assert 0.01 < grasp.position_error < 0.06
    assert "distance" in grasp.detail and "allowed 10 mm" in grasp.detail
    assert transfer.status == GraspEvent.REJECTED
    assert transfer.position_error != transfer.position_error  # NaN: it does not apply
    poses = messages.of(graph, DEPUTY_POSE)
    assert all(pose.pose == poses[0].pose for pose in poses)
    assert graph.plant.report().values["holder"] == "none"


def test_phases_and_references_keep_to_the_schedule(graph: Graph) -> None:
    graph.run()
    phases = Messages().of(graph, TASK_PHASE)
    names = [phase.name for phase in phases]
    assert sorted(set(names), key=names.index) == ["approach", "carry", "withdraw"]
    assert names.index("carry") * REFERENCE_NS == round(APPROACH_S * 1e9)
    assert [len(phase.commands) for phase in phases].count(0) == len(phases) - 2
    assert graph.stamps(JOINT_REFERENCE) == [header_ns(phase) for phase in phases]


def test_without_a_peer_nothing_begins(graph: Graph) -> None:
    """Every node but the ear says that it is ready; the plant waits for all."""
    ready: Callable[[], int] = lambda: len(graph.heard["run/ready"])  # noqa: E731
    graph.bench.until(lambda: ready() == 3, "the other nodes")
    assert graph.heard[JOINT_STATES] == graph.heard[BASE_ODOMETRY] == []
    graph.ear.get_ready(graph.bench)
    wait_for_tick(graph, 0)
