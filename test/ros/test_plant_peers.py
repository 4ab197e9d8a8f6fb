"""The plant node against made-up peers: what it takes, what it applies, what it reports, and in real time."""

from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import GraspEvent, LoopTiming, RunState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from sms_handover.graph.events import RESYNCHRONISED
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CLOCK,
    CONTROLLER,
    DEPUTY_POSE,
    DIAGNOSTICS,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_STATES,
    LOOP_TIMING,
    MPC_STATUS,
    PLANNED_PATHS,
    PLANT,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_READY,
    RUN_RECORDED,
    RUN_STATE,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
)
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.values import run_event
from sms_handover.ros.codecs.convert import header, phase_message
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.simulation.parameters import DIRECT
from sms_handover.types import Array, GraspAction, GraspCommand, TaskPhase

from .bench import DEADLINE_S, Bench
from .graph import TOPICS, Graph, Messages

pytestmark = pytest.mark.ros

TICK_NS = 1_000_000
REFERENCE_NS = 20_000_000
GRASP_A = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
RELEASE_A = GraspCommand(GraspAction.RELEASE, "arm_a")

Effort = Callable[[int], Array]


class FakeController:
    """Answers every state, and in place of the trajectory node gives the phases."""

    def __init__(
        self,
        node: Node,
        peers: Sequence[str],
        effort: Effort,
        commands: Mapping[int, tuple[GraspCommand, ...]],
        *,
        names: Sequence[str] | None = None,
        silent: bool = False,
    ) -> None:
        """Give ``effort`` by tick, in the order of ``names``, and grasp commands by stamp."""
        self._effort, self._commands, self._names, self._silent = effort, commands, names, silent
        self._endpoints = Endpoints(node, TOPICS, peers)
        self._command = self._endpoints.publisher(JOINT_COMMAND)
        self._phase = self._endpoints.publisher(TASK_PHASE)
        self._ready = self._endpoints.publisher(RUN_READY)
        for unused in (DIAGNOSTICS, MPC_STATUS, PLANNED_PATHS, RUN_EVENTS, RUN_PUBLISHED):
            self._endpoints.publisher(unused)
        self._endpoints.subscribe(JOINT_STATES, self._on_state)
        for unread in (BASE_ODOMETRY, GRASP_EVENT):
            self._endpoints.subscribe(unread, lambda message: None)
        self._endpoints.subscribe(RUN_STATE, self._on_run)

    def get_ready(self, bench: Bench) -> None:
        """Wait for the plant, and say so."""
        bench.until(lambda: not self._endpoints.unmatched, "the endpoints of the plant")
        self._ready.publish(String(data=CONTROLLER))

    def _on_run(self, message: Any) -> None:
        """Be ready for the next run."""
        if message.state == RunState.WAITING:
            self._ready.publish(String(data=CONTROLLER))

    def _on_state(self, message: Any) -> None:
        """Answer a state, a phase first where one is due."""
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        if stamp % REFERENCE_NS == 0:
            phase = TaskPhase(stamp, 0, "made up", self._commands.get(stamp, ()))
            self._phase.publish(phase_message(phase))
        if self._silent:
            return
        names = self._names or message.name
        answer = JointState(header=header(stamp, ""), name=list(names))
        answer.effort = self._effort(stamp // TICK_NS).tolist()
        self._command.publish(answer)


def no_effort(tick: int) -> Array:
    return np.zeros(14)


def plant_with(
    bench: Bench,
    effort: Effort = no_effort,
    commands: Mapping[int, tuple[GraspCommand, ...]] | None = None,
    *,
    duration: float = 0.04,
    common: Mapping[str, object] | None = None,
    plant: Mapping[str, object] | None = None,
    **options: Any,
) -> Graph:
    """Return a plant with a made-up controller, ready to run."""

    def fake(node: Node, peers: Sequence[str]) -> FakeController:
        return FakeController(node, peers, effort, commands or {}, **options)

    parameters = {"common": {"duration": duration, **(common or {})}, PLANT: plant or {}}
    graph = Graph(bench, parameters, fakes={CONTROLLER: fake}, names=(PLANT, CONTROLLER))
    graph.fakes[CONTROLLER].get_ready(bench)
    return graph


def efforts(graph: Graph) -> list[list[float]]:
    return [list(state.effort) for state in Messages().of(graph, JOINT_STATES)]


def test_every_state_tells_what_was_applied_before_it(bench: Bench) -> None:
    """Effort k of the command acts over the tick that ends at stamp k + 1; the limits of the Gen3 hold."""
    wanted = np.array([1.0, -2.0, 0.5, 0.0, 0.1, -0.1, 0.01] * 2)
    graph = plant_with(bench, lambda tick: wanted * (tick % 3))
    graph.run()
    assert efforts(graph) == [[0.0] * 14] + [(wanted * (k % 3)).tolist() for k in range(40)]
    assert not any(name.startswith("saturated") for name in graph.plant.report().values)


def test_saturation_is_applied_and_reported(bench: Bench) -> None:
    """All joints beyond their limits for ten ticks, then one of them for five more."""

    def effort(tick: int) -> Array:
        values = np.zeros(14)
        if tick < 10:
            values[:] = 1000.0
            values[7:] = -1000.0
        elif tick < 15:
            values[2] = 39.5
        return values

    graph = plant_with(bench, effort)
    graph.run()
    limits = [39.0] * 4 + [9.0] * 3
    assert efforts(graph)[1] == limits + [-limit for limit in limits]
    assert efforts(graph)[11] == [0.0, 0.0, 39.0] + [0.0] * 11
    told = graph.plant.report().values
    names = graph.plant.robot.joint_names
    assert {name: told[f"saturated_{name}"] for name in names} == {**dict.fromkeys(names, 10), names[2]: 15}


def test_commands_are_matched_by_name(bench: Bench) -> None:
    names = [f"{arm}_joint_{number}" for arm in ("arm_b", "arm_a") for number in (7, 1, 6, 2, 5, 3, 4)]
    values = np.linspace(-1.0, 1.0, 14)
    graph = plant_with(bench, lambda tick: values, names=names)
    graph.run()
    by_name = dict(zip(names, values.tolist(), strict=True))
    assert efforts(graph)[1] == [by_name[name] for name in graph.plant.robot.joint_names]


def test_a_command_without_a_joint_is_as_none(bench: Bench) -> None:
    """It is refused by its reason, and the plant goes on waiting."""
    names = [f"{arm}_joint_{number}" for arm in ("arm_a", "arm_b") for number in range(1, 8)]
    graph = plant_with(bench, names=[*names[:-1], "arm_b_joint_8"])
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.message_filter.counts, "a refusal")
    assert graph.plant.message_filter.counts == {f"{JOINT_COMMAND}: wrong names": 1}
    assert graph.plant.report().stamp_ns == 0


def test_without_an_answer_the_plant_waits(bench: Bench) -> None:
    graph = plant_with(bench, silent=True)
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.heard[TASK_PHASE], "the first phase")
    assert graph.call("pause", SetBool, data=True).success  # as long as many ticks take
    assert set(graph.stamps(JOINT_STATES)) == {0}


def test_a_state_that_nobody_answers_is_sent_again(bench: Bench) -> None:
    """The same bytes, on every topic that the loop waits for; what nobody waits for goes out once."""
    graph = plant_with(bench, silent=True, plant={"resend_after": 0.05})
    graph.ear.get_ready(bench)
    asked = (JOINT_STATES, BASE_ODOMETRY, SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE)
    bench.until(lambda: all(len(graph.heard[topic]) >= 3 for topic in asked), "the state three times")
    assert all(len(set(graph.heard[topic])) == 1 for topic in asked)
    assert len(graph.heard[CLOCK]) == 1
    assert graph.call("pause", SetBool, data=True).success
    assert graph.plant.report().stamp_ns == 0


def test_a_grasp_far_away_misses_and_what_makes_no_sense_is_rejected(bench: Bench) -> None:
    commands = {
        0: (RELEASE_A,),
        20_000_000: (GraspCommand(GraspAction.GRASP, "arm_b", "end_a"),),
        40_000_000: (GRASP_A, GRASP_A, RELEASE_A),
    }
    graph = plant_with(bench, commands=commands)
    graph.run()
    messages = Messages()
    found = [
        (stamp, event.status)
        for stamp, event in zip(graph.stamps(GRASP_EVENT), messages.of(graph, GRASP_EVENT), strict=True)
    ]
    assert found == [
        (0, GraspEvent.REJECTED),
        (20_000_000, GraspEvent.MISSED),
        (40_000_000, GraspEvent.SUCCEEDED),
        (40_000_000, GraspEvent.REJECTED),
        (40_000_000, GraspEvent.SUCCEEDED),
    ]
    details = [event.detail for event in messages.of(graph, GRASP_EVENT)]
    assert details[0] == "arm_a does not hold the deputy"
    assert "distance" in details[1]
    assert details[2:] == ["arm_a holds the deputy", "arm_a holds the deputy already", "arm_a let go"]
    first, *others = messages.of(graph, DEPUTY_POSE)
    assert all(pose.pose == first.pose for pose in others)  # nobody moved


# Real time


class FastClock:
    """A wall clock that moves by half a tick whenever somebody looks at it."""

    def __init__(self) -> None:
        """Start somewhere."""
        self.now = 100.0

    def __call__(self) -> float:
        """Return the time in s."""
        self.now += 0.0005
        return self.now


class StopWhen:
    """Asks a node to stop when a condition holds, and fails the test if it never does."""

    def __init__(self, condition: Callable[[], bool]) -> None:
        """Take the condition."""
        self._condition = condition
        self._deadline = monotonic() + DEADLINE_S

    @property
    def asked(self) -> bool:
        """Whether to stop."""
        assert monotonic() < self._deadline, "waited in vain"
        return self._condition()


@pytest.fixture
def fast_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sms_handover.ros.transport.loop_clock.monotonic", FastClock())


def run_until(graph: Graph, condition: Callable[[], bool]) -> None:
    """Let the plant's own loop run until a condition holds."""
    stop: Any = StopWhen(condition)
    graph.plant.run(graph.bench.executor, stop)


REALTIME = {"mode": "realtime"}


def test_in_real_time_the_last_command_is_held(bench: Bench, fast_clock: None) -> None:
    """The controller never answers: every tick goes on with the command of the start, and counts as held."""
    graph = plant_with(bench, common=REALTIME, duration=0.5, silent=True)
    graph.ear.get_ready(bench)
    run_until(graph, lambda: graph.plant.finished and graph.everything_heard())
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(501)]
    assert efforts(graph) == [[0.0] * 14] * 501
    last = Messages().of(graph, RUN_STATE)[-1]
    assert (last.state, last.tick) == (RunState.FINISHED, 500)


def test_in_real_time_a_controller_of_the_same_thread_answers_late_ticks_too(
    bench: Bench, fast_clock: None
) -> None:
    """The clock leaves it no time before the next tick, and still no command is held."""
    common = {**REALTIME, "transport": DIRECT, "duration": 0.2}
    graph = Graph(bench, {"common": common}, names=(PLANT, CONTROLLER))
    graph.plant.accompany([graph.nodes[CONTROLLER]])
    graph.ear.get_ready(bench)
    run_until(graph, lambda: graph.plant.finished)
    bench.until(graph.everything_heard, "all messages")
    assert len(graph.heard[JOINT_COMMAND]) == 201
    assert " 0 held an old command" in Messages().of(graph, RUN_STATE)[-1].detail


def test_in_real_time_a_reset_after_the_end_runs_again(bench: Bench, fast_clock: None) -> None:
    graph = plant_with(bench, common=REALTIME, duration=0.1)
    graph.ear.get_ready(bench)
    client = graph.client.create_client(Trigger, f"{PLANT}/reset")
    asked: list[Any] = []

    def ended_twice() -> bool:
        changes = len(graph.heard[RUN_STATE])
        if changes == 2 and not asked:
            asked.append(client.call_async(Trigger.Request()))
        return changes == 5

    run_until(graph, ended_twice)
    bench.until(graph.everything_heard, "all messages")
    states = [state.state for state in Messages().of(graph, RUN_STATE)]
    once = [RunState.RUNNING, RunState.FINISHED]
    assert states == [*once, RunState.WAITING, *once]
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(101)] * 2


def test_in_real_time_a_paused_plant_stands_still_and_goes_on(bench: Bench, fast_clock: None) -> None:
    graph = plant_with(bench, common=REALTIME, duration=0.3)
    graph.ear.get_ready(bench)
    run_until(graph, lambda: graph.plant.report().stamp_ns >= 50 * TICK_NS)
    pause = graph.client.create_client(SetBool, f"{PLANT}/pause")
    bench.until(pause.service_is_ready, "the service")
    asked = pause.call_async(SetBool.Request(data=True))
    run_until(graph, asked.done)
    at = graph.plant.report().stamp_ns
    looks = iter(range(51))
    run_until(graph, lambda: next(looks) == 50)
    assert graph.plant.report().stamp_ns == at
    pause.call_async(SetBool.Request(data=False))
    run_until(graph, lambda: graph.plant.finished and graph.everything_heard())
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(301)]


def test_in_real_time_a_suspension_is_skipped_and_reported(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """5 s asleep are no 5000 ticks back to back: simulated time stays behind, and no tick is left out."""
    clock = FastClock()
    monkeypatch.setattr("sms_handover.ros.transport.loop_clock.monotonic", clock)
    graph = plant_with(bench, common=REALTIME, plant={"catch_up": 1.0}, duration=0.2)
    graph.ear.get_ready(bench)
    run_until(graph, lambda: graph.plant.report().stamp_ns >= 50 * TICK_NS)
    clock.now += 5.0
    before, ticked_at = clock.now, graph.plant.report().stamp_ns
    run_until(graph, lambda: graph.plant.finished and graph.everything_heard())
    events = [run_event(message) for message in Messages().of(graph, RUN_EVENTS)]
    (event,) = (event for event in events if event.kind == RESYNCHRONISED)
    assert (event.limit, event.unit) == (1.0, "s of wall time")
    assert event.stamp_ns == ticked_at + TICK_NS and 5.0 < event.value < 6.0
    assert graph.plant.report().values["skipped_s"] == event.value
    assert clock.now - before > 0.14  # s: the ticks that were left took at least their time
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(201)]
    assert "s of lag were skipped" in Messages().of(graph, RUN_STATE)[-1].detail


def test_in_real_time_the_loop_reports_its_timing(bench: Bench) -> None:
    slow = {**REALTIME, "tick": 0.01}  # s: slow enough for one process that is everybody, on a busy machine
    graph = plant_with(bench, common=slow, duration=60.0)
    graph.ear.get_ready(bench)
    run_until(graph, lambda: len(graph.heard[LOOP_TIMING]) >= 1)
    report: LoopTiming = Messages().of(graph, LOOP_TIMING)[0]
    assert 0 < report.ticks <= len(graph.heard[JOINT_STATES])
    assert 0.0 < report.period_mean <= report.period_max
    assert stamp_ns(graph.heard[LOOP_TIMING][0]) <= graph.plant.report().stamp_ns


def test_it_waits_for_a_recorder_that_is_behind(bench: Bench) -> None:
    """What a killed recorder can lose is bounded: the plant goes no further ahead of what is in the bag."""
    graph = plant_with(bench, duration=0.2)
    graph.ear.recorded_ns = 30_000_000
    graph.ear.get_ready(bench)
    bench.until(lambda: graph.plant.awaited == RUN_RECORDED, "the plant to wait")
    assert graph.stamps(JOINT_STATES)[-1] <= 75_000_000
    bench.until(lambda: graph.stamps(JOINT_STATES)[-1] == 75_000_000, "the last state before that")
    assert not graph.plant.finished
    graph.ear.recorded_ns = None
    graph.ear.tell_recorded(75_000_000)
    graph.wait_for_end()
    assert graph.stamps(JOINT_STATES) == [k * TICK_NS for k in range(201)]
