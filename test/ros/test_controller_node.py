"""The controller answers inputs of equal stamp only, in whatever order they arrive."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sms_handover_interfaces.msg import RunState

from sms_handover.control.law import Need
from sms_handover.control.protocol import Controller, Guidance
from sms_handover.control.registry import law_named
from sms_handover.errors import UnknownNameError, UnstableLoopError
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    PLANT,
    RUN_READY,
    RUN_STATE,
    TASK_PHASE,
    TRAJECTORY,
    target_pose,
)
from sms_handover.messages.stamps import stamp_ns
from sms_handover.model.poses import pose_row
from sms_handover.nodes.controller import ControllerNode
from sms_handover.ros.codecs.convert import event_message, phase_message
from sms_handover.ros.codecs.loop_messages import JointStateCodec, PoseCodec, StateCodec
from sms_handover.ros.node.endpoints import CountedPublisher, Endpoints
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.wiring import initial_joints, make_controller
from sms_handover.types import (
    Array,
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    JointReference,
    Pose,
    RobotState,
    TaskPhase,
)

from ..core.laws import offer
from .bench import Bench
from .graph import TOPICS
from .short_handover import short_handover

pytestmark = pytest.mark.ros

REFERENCE_NS = 20_000_000
GRASP = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
INPUTS = (JOINT_STATES, BASE_ODOMETRY, JOINT_REFERENCE, TASK_PHASE)


class Rest:
    """The rest of the graph by hand: publishers of all inputs, and the commands that come back."""

    def __init__(self, bench: Bench, **controller: object) -> None:
        """Start a controller and match it."""
        path = bench.folder / "schedule.yaml"
        path.write_text(short_handover(), encoding="utf-8")
        common = {"schedule": str(path), "peers": (PLANT, CONTROLLER)}
        common.update({key: controller.pop(key) for key in ("mode",) if key in controller})  # type: ignore[misc]
        bench.start({"common": common, CONTROLLER: controller})
        self.bench = bench
        self.scenario: Scenario = load_scenario(values={"common": common, CONTROLLER: controller})
        self.node = bench.add(ControllerNode)
        endpoints = Endpoints(bench.plain(PLANT), TOPICS, (PLANT, CONTROLLER))
        self._publish: dict[str, CountedPublisher] = {
            name: endpoints.publisher(name) for name in (*INPUTS, *self._targets(), GRASP_EVENT, RUN_STATE)
        }
        self.commands: list[bytes] = []
        endpoints.subscribe(JOINT_COMMAND, self.commands.append, raw=True)
        ready: list[Any] = []
        endpoints.subscribe(RUN_READY, ready.append)
        bench.until(lambda: ready and not endpoints.unmatched, "the controller")
        names = self.scenario.truth.robot.joint_names
        self._state_codec = StateCodec(names, WORLD, BASE)
        self._reference_codec = JointStateCodec(names, ("position", "velocity"))
        self._command_codec = JointStateCodec(names, ("effort",))

    def _targets(self) -> list[str]:
        """Return the topics of the targets of the tools, if the law follows them."""
        follows = Need.TOOL_TARGETS in law_named(self.scenario.parameters.controller.law).needs
        return [target_pose(arm) for arm in self.scenario.truth.robot.arms] if follows else []

    def messages(self, state: RobotState, reference: JointReference, phase: TaskPhase) -> dict[str, Any]:
        """Return the messages of one stamp by topic."""
        joints, odometry = self._state_codec.pack(state)
        position, velocity = reference.position, reference.velocity
        packed = self._reference_codec.pack(reference.stamp_ns, position=position, velocity=velocity)
        return {
            JOINT_STATES: joints,
            BASE_ODOMETRY: odometry,
            JOINT_REFERENCE: packed,
            TASK_PHASE: phase_message(phase),
        }

    def send(self, messages: Mapping[str, Any], *topics: str) -> None:
        """Publish the messages of some topics in this order."""
        for topic in topics:
            self._publish[topic].publish(messages[topic])

    def end_of_run(self) -> None:
        """Say that the run is over."""
        self._publish[RUN_STATE].publish(RunState(state=RunState.FINISHED))

    def wait_for(self, count: int) -> None:
        """Wait for a number of commands in all."""
        self.bench.until(lambda: len(self.commands) >= count, f"{count} commands")

    def efforts(self) -> list[Array]:
        """Return the commands so far."""
        return [self._command_codec.read(data)["effort"] for data in self.commands]

    def by_hand(self) -> Controller:
        """Return the controller of the core."""
        s = self.scenario
        return make_controller(s.model.robot, s.model.schedule, s.parameters.common, s.parameters.controller)


def inputs(rest: Rest, stamp: int, seed: int) -> tuple[RobotState, JointReference, TaskPhase]:
    """Return a state near the start, a reference near it, and a phase."""
    random = np.random.default_rng(seed)
    start = initial_joints(rest.scenario.truth.robot, rest.scenario.truth.schedule)
    noise = random.normal(scale=0.01, size=(5, 14))
    q = np.concatenate([0.1 * noise[0, :3], [0.0, 0.0, 0.0, 1.0], start + noise[2]])
    state = RobotState(stamp, q, np.concatenate([noise[1, :6], noise[3]]), np.zeros(14))
    reference = JointReference(stamp, start + noise[4], 0.1 * noise[0])
    index = min(stamp // (8 * REFERENCE_NS), 2)
    return state, reference, TaskPhase(stamp, index, rest.scenario.truth.schedule.phases[index].name)


def effort_of(controller: Controller, state: RobotState) -> Array:
    """Return what a controller answers a state."""
    return controller.effort(state.stamp_ns, state.q, state.v)


def answered_as(rest: Rest, expected: Controller, number: int, *order: str) -> RobotState:
    """Send all inputs of a stamp; the command is what a controller called by hand gives, bit for bit."""
    state, reference, phase = inputs(rest, number * REFERENCE_NS, number)
    rest.send(rest.messages(state, reference, phase), *order)
    rest.wait_for(number + 1)
    expected.guide(Guidance(phase, reference, {}))
    assert rest.efforts()[-1].tobytes() == effort_of(expected, state).tobytes()
    return state


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_any_order_of_arrival_gives_the_same_command(bench: Bench, law: str) -> None:
    """Each stamp in another of the 24 orders, from the first to the last phase."""
    rest = Rest(bench, law=law)
    expected = rest.by_hand()
    for number, order in enumerate(permutations(INPUTS)):
        state = answered_as(rest, expected, number, *order)
        assert stamp_ns(rest.commands[-1]) == state.stamp_ns
    assert len(rest.commands) == 24
    assert rest.node.report().values == {"law": law, "answered": 24, "late": 0}


def test_the_result_of_a_grasp_is_awaited_and_one_of_the_run_before_is_not_it(bench: Bench) -> None:
    """A controller that joins late is given what was latched; the next state waits for its own."""
    rest = Rest(bench)
    old, own = (
        event_message(GraspEvent(stamp, GRASP, GraspStatus.SUCCEEDED, 0.0, 0.0, 0.0, ""))
        for stamp in (10 * REFERENCE_NS, 0)
    )
    rest.send({GRASP_EVENT: old}, GRASP_EVENT)
    state, reference, phase = inputs(rest, 0, 0)
    rest.send(rest.messages(state, reference, replace(phase, commands=(GRASP,))), *INPUTS)
    rest.wait_for(1)
    rest.bench.until(lambda: rest.node.awaited == GRASP_EVENT, "the controller to wait for the grasp")
    rest.send(rest.messages(*inputs(rest, REFERENCE_NS, 1)), *INPUTS)
    rest.send({GRASP_EVENT: own}, GRASP_EVENT)
    rest.wait_for(2)


@pytest.mark.parametrize("missing", INPUTS)
def test_nothing_is_answered_before_all_inputs_are_there(bench: Bench, missing: str) -> None:
    """Inputs of another stamp do not complete one, neither those before nor those after it."""
    rest = Rest(bench)
    now = rest.messages(*inputs(rest, 0, 0))
    later = rest.messages(*inputs(rest, REFERENCE_NS, 1))
    others = [topic for topic in INPUTS if topic != missing]
    rest.send(now, *others)
    rest.send(later, missing)
    rest.end_of_run()
    rest.bench.until(lambda: rest.node.finished, "the end of the run, told after the inputs")
    assert rest.commands == []
    rest.send(now, missing)
    rest.wait_for(1)
    rest.send(later, *others)
    rest.wait_for(2)
    assert [stamp_ns(data) for data in rest.commands] == [0, REFERENCE_NS]


def test_between_references_the_state_is_enough(bench: Bench) -> None:
    rest = Rest(bench)
    expected = rest.by_hand()
    first = inputs(rest, 0, 0)
    rest.send(rest.messages(*first), *INPUTS)
    expected.guide(Guidance(first[2], first[1], {}))
    effort_of(expected, first[0])
    for tick, order in ((1, INPUTS[:2]), (2, INPUTS[1::-1]), (3, INPUTS[:2])):
        state, reference, phase = inputs(rest, tick * 1_000_000, tick)
        rest.send(rest.messages(state, reference, phase), *order)
        rest.wait_for(tick + 1)
        assert rest.efforts()[-1].tobytes() == effort_of(expected, state).tobytes()


def test_an_answered_stamp_is_not_answered_again(bench: Bench) -> None:
    """Whoever asks again gets the same bytes, and the law is not stepped: the integral of PID stays."""
    rest = Rest(bench, law="pid")
    expected = rest.by_hand()
    stamps = [0, REFERENCE_NS, REFERENCE_NS, 2 * REFERENCE_NS]
    for number, stamp in enumerate(stamps):
        rest.send(rest.messages(*inputs(rest, stamp, stamp)), *INPUTS)
        rest.wait_for(number + 1)
    assert [stamp_ns(data) for data in rest.commands] == stamps
    assert rest.commands[1] == rest.commands[2]
    for stamp in sorted(set(stamps)):
        state, reference, phase = inputs(rest, stamp, stamp)
        expected.guide(Guidance(phase, reference, {}))
        wanted = effort_of(expected, state)
    assert rest.efforts()[-1].tobytes() == wanted.tobytes()
    assert rest.node.report().values["late"] == 4


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_time_zero_restarts_run(bench: Bench, law: str) -> None:
    """After a whole run the same inputs give the same bits: nothing of the first one is left."""
    rest = Rest(bench, law=law)
    for count, number in enumerate((*range(20), *range(20))):
        rest.send(rest.messages(*inputs(rest, number * REFERENCE_NS, number)), *INPUTS)
        rest.wait_for(count + 1)
    assert rest.commands[20:] == rest.commands[:20]
    assert rest.node.report().values["late"] == 0


def test_a_first_reference_that_comes_again_late_changes_nothing(bench: Bench) -> None:
    """As when the plant has sent its first state again, and the trajectory has answered it again."""
    rest = Rest(bench, law="pid")
    expected = rest.by_hand()
    for number in range(4):
        answered_as(rest, expected, number, *INPUTS)
        rest.send(rest.messages(*inputs(rest, 0, 0)), TASK_PHASE, JOINT_REFERENCE)


def test_in_real_time_the_last_reference_holds(bench: Bench) -> None:
    """No reference yet: no effort. Then the last one, whatever its stamp."""
    rest = Rest(bench, mode="realtime")
    expected = rest.by_hand()
    state, reference, phase = inputs(rest, 0, 0)
    rest.send(rest.messages(state, reference, phase), *INPUTS[:2])
    rest.wait_for(1)
    assert not np.any(rest.efforts()[0])
    effort_of(expected, state)
    rest.send(rest.messages(state, reference, phase), TASK_PHASE, JOINT_REFERENCE)
    expected.guide(Guidance(phase, reference, {}))
    for number in (1, 2, 3):
        state, reference, phase = inputs(rest, number * REFERENCE_NS, number)
        rest.send(rest.messages(state, reference, phase), *INPUTS[:2])
        rest.wait_for(number + 1)
        assert rest.efforts()[-1].tobytes() == effort_of(expected, state).tobytes()


def test_gains_that_cannot_work_are_refused_at_the_start(bench: Bench) -> None:
    bench.start({"common": {"tick": 0.002}, CONTROLLER: {"law": "pid"}})
    with pytest.raises(UnstableLoopError, match=r"unstable at the start configuration.*joint_7"):
        bench.add(ControllerNode)


def test_peers_of_the_controller_are_what_it_waits_for(bench: Bench) -> None:
    bench.start({"common": {"peers": (PLANT, TRAJECTORY, CONTROLLER)}})
    node = bench.add(ControllerNode)
    missing = node.endpoints.unmatched
    assert "0 of 1 subscriptions of joint_command" in missing
    assert "0 of 1 publishers of joint_states" in missing
    assert "0 of 1 publishers of task/phase" in missing


def test_an_unknown_law_is_refused_at_the_start(bench: Bench) -> None:
    bench.start({CONTROLLER: {"law": "pdi"}})
    with pytest.raises(UnknownNameError, match=r"controller: parameter 'law': .*did you mean 'pid'"):
        bench.add(ControllerNode)


def test_a_law_of_another_package_answers_as_in_one_process(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its name, with parameters of its own, and guided to the targets of the tools."""
    laws = {"task_space_pd": "my_controller.law:LAW"}
    monkeypatch.syspath_prepend(offer(tmp_path, "my_controller", **laws))
    rest = Rest(bench, law="task_space_pd", stiffness=3.0)
    expected = rest.by_hand()
    for number in range(3):
        state, reference, phase = inputs(rest, number * REFERENCE_NS, number)
        targets = rest.scenario.truth.robot.tools_at(state.q)
        targets = {arm: Pose(pose.position + 0.01, pose.quaternion_xyzw) for arm, pose in targets.items()}
        messages = rest.messages(state, reference, phase)
        codec = PoseCodec(WORLD)
        messages.update({target_pose(a): codec.pack(state.stamp_ns, pose_row(p)) for a, p in targets.items()})
        rest.send(messages, *INPUTS, *map(target_pose, targets))
        rest.wait_for(number + 1)
        expected.guide(Guidance(phase, reference, targets))
        assert rest.efforts()[-1].tobytes() == effort_of(expected, state).tobytes()
        assert np.any(rest.efforts()[-1])
