"""The controller answers every state, with the gains of the phase in force."""

from typing import Any

import numpy as np
import pytest

from sms_handover.control.law import Law, LawSetup
from sms_handover.control.nmpc import NMPC, NmpcGains, NmpcLaw
from sms_handover.control.pid import PID, PidGains
from sms_handover.control.protocol import Controller, Guidance
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, JointReference, RobotState, TaskPhase

from .conftest import Draw, Gains, law_of, state_of

_TICK_NS = 1_000_000
_SETS: dict[str, tuple[Gains, Gains]] = {
    "nmpc": (NmpcGains(1.0, 0), NmpcGains(2.0, 1)),
    "pid": (PidGains(2.0, 1.0, 1.5), PidGains(1.0, 0.5, 1.0)),
}


class Bench:
    """A controller with two phases, and a state and a reference to feed it."""

    def __init__(self, robot: RobotModel, draw: Draw, gains: tuple[Gains, Gains]) -> None:
        """Bend the arms."""
        self.robot, self.gains = robot, gains
        self.joints = np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2)
        self.q = robot.configuration(draw.pose(), self.joints)
        self.v = draw.v(0.05)
        self.wanted = self.joints + draw.vector(14, 0.05)
        law: Law[Any] = NMPC if isinstance(gains[0], NmpcGains) else PID
        self.controller: Controller = law.make(LawSetup(robot, gains, _TICK_NS))

    def state(self, stamp_ns: int) -> RobotState:
        """Return the state at a time."""
        return state_of(self.robot, self.q, self.v, stamp_ns)

    def answer(self, stamp_ns: int) -> Array:
        """Return the efforts that answer the state of a time."""
        return self.controller.effort(stamp_ns, self.q, self.v)

    def guide(self, stamp_ns: int, phase: int = 0, velocity: Array | float = 0.0) -> None:
        """Guide the controller: the phase of an index, and a reference at rest unless it has a velocity."""
        reference = JointReference(stamp_ns, self.wanted, np.zeros(14) + velocity)
        self.controller.guide(Guidance(TaskPhase(stamp_ns, phase, f"phase {phase}"), reference, {}))

    def expected(self, gains: Gains) -> Array:
        """Return what a fresh law with these gains answers."""
        desired = np.array([self.wanted, np.zeros(14), np.zeros(14)])
        state = self.state(0)
        effort: Array = law_of(self.robot, gains).effort(state.q, state.v, desired, 1e-3)
        return effort


@pytest.fixture(params=sorted(_SETS))
def bench(request: pytest.FixtureRequest, robot: RobotModel, draw: Draw) -> Bench:
    """A bench for each law."""
    return Bench(robot, draw, _SETS[request.param])


def test_without_a_reference_no_joint_is_moved(bench: Bench) -> None:
    """Until it knows where to go the controller answers with zero efforts, stamped like the state."""
    effort = bench.answer(7 * _TICK_NS)
    np.testing.assert_array_equal(effort, np.zeros(14))


def test_a_command_answers_the_state_of_its_stamp(bench: Bench) -> None:
    """It is the law's effort for that state and the reference, and carries that stamp."""
    bench.guide(0)
    effort = bench.answer(3 * _TICK_NS)
    np.testing.assert_array_equal(effort, bench.expected(bench.gains[0]))


def test_a_phase_brings_its_own_gains(bench: Bench) -> None:
    """From the first command of a phase on its gains act, and no longer those of the phase before."""
    bench.guide(0)
    bench.guide(20 * _TICK_NS, phase=1)
    effort = bench.answer(20 * _TICK_NS)
    np.testing.assert_array_equal(effort, bench.expected(bench.gains[1]))
    assert np.any(effort != bench.expected(bench.gains[0]))


def test_entering_the_same_phase_again_keeps_everything(robot: RobotModel, draw: Draw) -> None:
    """The phase is announced every period; only a new one may break the reference's difference quotient."""
    bench = Bench(robot, draw, _SETS["nmpc"])
    acceleration = draw.vector(14, 0.1)
    for stamp_ns in (0, 20 * _TICK_NS):
        bench.guide(stamp_ns, velocity=acceleration * stamp_ns * 1e-9)
    desired = np.array([bench.wanted, acceleration * 0.02, acceleration])
    state = bench.state(0)
    expected = NmpcLaw(robot, NmpcGains(1.0, 0)).effort(state.q, state.v, desired, 1e-3)
    # the acceleration is a difference of velocities of 2e-3 over 20 ms, times an inertia below 3
    np.testing.assert_allclose(bench.answer(20 * _TICK_NS), expected, atol=1e-14)


def test_a_new_phase_takes_no_acceleration_from_the_old_one(robot: RobotModel, draw: Draw) -> None:
    """At a phase change the desired velocity jumps; no effort may come from that jump."""
    bench = Bench(robot, draw, (NmpcGains(1.0, 0), NmpcGains(1.0, 0)))
    bench.guide(0, velocity=5.0)
    bench.guide(20 * _TICK_NS, phase=1)
    effort = bench.answer(20 * _TICK_NS)
    np.testing.assert_array_equal(effort, bench.expected(NmpcGains(1.0, 0)))


def test_reset_repeats_the_run_bit_for_bit(bench: Bench) -> None:
    """Integral, phase and reference all go back to the start."""
    runs = []
    for _ in range(2):
        efforts = [bench.answer(0)]
        bench.guide(0)
        efforts += [bench.answer(tick * _TICK_NS) for tick in range(5)]
        bench.guide(5 * _TICK_NS, phase=1)
        efforts.append(bench.answer(5 * _TICK_NS))
        runs.append(np.array(efforts))
        bench.controller.reset()
    np.testing.assert_array_equal(runs[0], runs[1])
