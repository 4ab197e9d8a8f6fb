"""The stand-in for controller and trajectory: what it answers a plant, and what it makes of the states."""

from collections.abc import Sequence

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sms_handover_interfaces.msg import RunState, TaskPhase

from sms_handover.bag.run.ticks import RecordedTick
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_STATES,
    PLANT,
    RUN_READY,
    RUN_STATE,
    TASK_PHASE,
    graph_topics,
)
from sms_handover.launcher.command_replay import PEERS, CommandReplay
from sms_handover.messages.stamps import stamp_ns
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.codecs.convert import header
from sms_handover.ros.codecs.loop_messages import JointStateCodec, StateCodec
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.types import RobotState

from .bench import Bench

pytestmark = pytest.mark.ros

TICK_NS = 1_000_000
ROBOT = RobotModel.load()
COMMANDS = JointStateCodec(ROBOT.joint_names, ("effort",))
STATES = StateCodec(ROBOT.joint_names, WORLD, BASE)


def state(tick: int, angle: float = 0.0) -> tuple[bytes, bytes]:
    """Return the messages of a state in which every joint is at an angle."""
    n = ROBOT.n_joints
    q = np.concatenate([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], np.full(n, angle)])
    return STATES.pack(RobotState(tick * TICK_NS, q, np.zeros(6 + n), np.zeros(n)))


def command(tick: int) -> bytes:
    """Return a command whose efforts tell the tick."""
    return COMMANDS.pack(tick * TICK_NS, effort=np.full(ROBOT.n_joints, float(tick)))


def recorded(ticks: Sequence[int], *, without_command: Sequence[int] = ()) -> list[RecordedTick]:
    """Return recorded ticks; every second one has a phase."""
    found = []
    for tick in ticks:
        phase = serialize_message(TaskPhase(header=header(tick * TICK_NS), name=f"phase {tick}"))
        answer = None if tick in without_command else command(tick)
        found.append(RecordedTick(tick * TICK_NS, *state(tick), answer, phase if tick % 2 == 0 else None))
    return found


_PUBLISHED = (JOINT_STATES, BASE_ODOMETRY, RUN_STATE, GRASP_EVENT)


class FakePlant:
    """Publishes the states that the test says, and keeps the answers."""

    def __init__(self, bench: Bench, ticks: list[RecordedTick]) -> None:
        """Start a replay of these ticks, and wait until it is ready."""
        bench.start()
        self._bench = bench
        self._endpoints = Endpoints(bench.plain(PLANT), graph_topics(ROBOT.arms), PEERS)
        self._publish = {n: self._endpoints.publisher(n) for n in _PUBLISHED}
        self.commands: list[bytes] = []
        self.phases: list[TaskPhase] = []
        self.ready: list[str] = []
        self._endpoints.subscribe(JOINT_COMMAND, self.commands.append, raw=True)
        self._endpoints.subscribe(TASK_PHASE, self.phases.append)
        self._endpoints.subscribe(RUN_READY, lambda message: self.ready.append(message.data))
        self.replay = CommandReplay(bench.plain(CONTROLLER), iter(ticks), ROBOT, 2 * TICK_NS)
        bench.until(lambda: self.ready == [CONTROLLER], "the stand-in")
        bench.until(lambda: not self._endpoints.unmatched, "the endpoints")

    def tick(self, tick: int, angle: float = 0.0) -> None:
        """Publish a state and wait until it has been seen."""
        joints, odometry = state(tick, angle)
        self._publish[BASE_ODOMETRY].publish(odometry)
        self._publish[JOINT_STATES].publish(joints)
        self._bench.until(lambda: self.replay.stamp_ns == tick * TICK_NS, f"tick {tick}")

    def again(self, joints: bytes) -> None:
        """Publish a joint state, good or bad, and wait until it has been seen or refused."""
        before = len(self.commands) + sum(self.replay.refusals.counts.values())
        self._publish[JOINT_STATES].publish(joints)
        self._bench.until(
            lambda: len(self.commands) + sum(self.replay.refusals.counts.values()) > before, "what came of it"
        )

    def end(self) -> None:
        """Say that the run is over."""
        self._publish[RUN_STATE].publish(RunState(state=RunState.FINISHED))
        self._bench.until(lambda: self.replay.done, "the end")

    def efforts(self, count: int) -> list[tuple[int, float]]:
        """Wait for so many commands and return the tick and the effort of each."""
        self._bench.until(lambda: len(self.commands) >= count, f"{count} commands")
        return [
            (stamp_ns(data) // TICK_NS, float(COMMANDS.read(data)["effort"][0])) for data in self.commands
        ]


def test_every_state_is_answered_with_what_was_recorded(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(4)))
    for tick in range(4):
        plant.tick(tick)
    assert plant.efforts(4) == [(0, 0.0), (1, 1.0), (2, 2.0), (3, 3.0)]
    assert plant.commands == [command(tick) for tick in range(4)]
    assert [phase.name for phase in plant.phases] == ["phase 0", "phase 2"]
    plant.end()
    deviation = plant.replay.deviation
    assert (deviation.compared, deviation.first, plant.replay.held) == (4, None, 0)


def test_a_state_that_comes_again_is_answered_again(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(4)))
    plant.tick(0)
    plant.efforts(1)
    plant.again(state(0)[0])
    plant.tick(1)
    assert plant.efforts(3) == [(0, 0.0), (0, 0.0), (1, 1.0)]
    bench.until(lambda: len(plant.phases) == 2, "the phase again")
    assert [phase.name for phase in plant.phases] == ["phase 0", "phase 0"]
    assert plant.replay.deviation.compared == 2


def test_bad_states_are_refused_and_counted(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(4)))
    for tick in range(3):
        plant.tick(tick)
    plant.efforts(3)
    for bad in (state(1)[0], state(3)[0][:40], state(3, np.nan)[0]):
        plant.again(bad)
    plant.tick(3)
    assert plant.efforts(4)[3] == (3, 3.0)
    reasons = ("stamp out of order", "malformed", "not finite")
    assert plant.replay.refusals.counts == {f"joint_states: {reason}": 1 for reason in reasons}


def test_a_missing_command_is_held_with_the_stamp_of_the_state(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(4), without_command=(2,)))
    for tick in range(4):
        plant.tick(tick)
    assert plant.efforts(4) == [(0, 0.0), (1, 1.0), (2, 1.0), (3, 3.0)]
    assert plant.replay.held == 1


def test_a_tick_that_was_not_recorded_is_answered_and_not_compared(bench: Bench) -> None:
    plant = FakePlant(bench, recorded((0, 1, 3)))
    for tick in range(4):
        plant.tick(tick)
    assert plant.efforts(4) == [(0, 0.0), (1, 1.0), (2, 1.0), (3, 3.0)]
    assert (plant.replay.held, plant.replay.deviation.compared) == (1, 3)


def test_before_any_recorded_command_there_is_none(bench: Bench) -> None:
    """As for a plant in real time; a phase that lacks is one without grasp commands."""
    plant = FakePlant(bench, recorded((2, 3)))
    for tick in range(3):
        plant.tick(tick)
    assert plant.efforts(3) == [(0, 0.0), (1, 0.0), (2, 2.0)]
    bench.until(lambda: len(plant.phases) == 2, "two phases")
    assert [(phase.name, list(phase.commands)) for phase in plant.phases] == [("", []), ("phase 2", [])]
    assert plant.replay.held == 2


def test_behind_the_recording_it_is_over(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(2)))
    for tick in range(3):
        plant.tick(tick)
    assert plant.replay.done
    assert plant.replay.deviation.compared == 2


def test_what_deviates_is_noted_with_its_time(bench: Bench) -> None:
    plant = FakePlant(bench, recorded(range(4)))
    for tick, angle in enumerate((0.0, 0.0, 1e-9, 1e-12)):
        plant.tick(tick, angle)
    deviation = plant.replay.deviation
    assert deviation.compared == 4
    assert deviation.first is not None and deviation.first.stamp_ns == 2 * TICK_NS
    assert deviation.joint is not None and deviation.joint.joint_angle == 1e-9
