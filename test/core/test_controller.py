"""The controller answers every state, with the gains of the phase in force."""

import numpy as np
import pytest

from sms_handover.control.controller import Gains, JointController, make_law
from sms_handover.control.nmpc import NmpcGains, NmpcLaw
from sms_handover.control.pid import PidGains, PidLaw
from sms_handover.errors import UnstableLoopError
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, JointReference, RobotState, TaskPhase

from .conftest import Draw, state_of

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
        self.controller = JointController(robot, gains, _TICK_NS, self.q)

    def state(self, stamp_ns: int) -> RobotState:
        """Return the state at a time."""
        return state_of(self.robot, self.q, self.v, stamp_ns)

    def answer(self, stamp_ns: int) -> Array:
        """Return the efforts that answer the state of a time."""
        return self.controller.effort(stamp_ns, self.q, self.v)

    def reference(self, stamp_ns: int) -> JointReference:
        """Return a reference at rest."""
        return JointReference(stamp_ns, self.wanted, np.zeros(14))

    def expected(self, gains: Gains) -> Array:
        """Return what a fresh law with these gains answers."""
        desired = np.array([self.wanted, np.zeros(14), np.zeros(14)])
        state = self.state(0)
        effort: Array = make_law(self.robot, gains).effort(state.q, state.v, desired, 1e-3)
        return effort


@pytest.fixture(params=sorted(_SETS))
def bench(request: pytest.FixtureRequest, robot: RobotModel, draw: Draw) -> Bench:
    """A bench for each law."""
    return Bench(robot, draw, _SETS[request.param])


def test_the_law_is_that_of_its_gains(robot: RobotModel) -> None:
    """The kind of gains decides which law runs."""
    assert isinstance(make_law(robot, _SETS["nmpc"][0]), NmpcLaw)
    assert isinstance(make_law(robot, _SETS["pid"][0]), PidLaw)


def test_without_a_reference_no_joint_is_moved(bench: Bench) -> None:
    """Until it knows where to go the controller answers with zero efforts, stamped like the state."""
    effort = bench.answer(7 * _TICK_NS)
    np.testing.assert_array_equal(effort, np.zeros(14))


def test_a_command_answers_the_state_of_its_stamp(bench: Bench) -> None:
    """It is the law's effort for that state and the reference, and carries that stamp."""
    bench.controller.track(bench.reference(0))
    effort = bench.answer(3 * _TICK_NS)
    np.testing.assert_array_equal(effort, bench.expected(bench.gains[0]))


def test_a_phase_brings_its_own_gains(bench: Bench) -> None:
    """From the first command of a phase on its gains act, and no longer those of the phase before."""
    bench.controller.enter(TaskPhase(0, 0, "first"))
    bench.controller.track(bench.reference(0))
    bench.controller.enter(TaskPhase(0, 1, "second"))
    effort = bench.answer(0)
    np.testing.assert_array_equal(effort, bench.expected(bench.gains[1]))
    assert np.any(effort != bench.expected(bench.gains[0]))


def test_entering_the_same_phase_again_keeps_everything(robot: RobotModel, draw: Draw) -> None:
    """The phase is announced every period; only a new one may break the reference's difference quotient."""
    bench = Bench(robot, draw, _SETS["nmpc"])
    acceleration = draw.vector(14, 0.1)
    phase = TaskPhase(0, 0, "first")
    for stamp_ns in (0, 20 * _TICK_NS):
        bench.controller.enter(phase)
        velocity = acceleration * stamp_ns * 1e-9
        bench.controller.track(JointReference(stamp_ns, bench.wanted, velocity))
    desired = np.array([bench.wanted, acceleration * 0.02, acceleration])
    state = bench.state(0)
    expected = NmpcLaw(robot, NmpcGains(1.0, 0)).effort(state.q, state.v, desired, 1e-3)
    # the acceleration is a difference of velocities of 2e-3 over 20 ms, times an inertia below 3
    np.testing.assert_allclose(bench.answer(20 * _TICK_NS), expected, atol=1e-14)


def test_a_new_phase_takes_no_acceleration_from_the_old_one(robot: RobotModel, draw: Draw) -> None:
    """At a phase change the desired velocity jumps; no effort may come from that jump."""
    bench = Bench(robot, draw, (NmpcGains(1.0, 0), NmpcGains(1.0, 0)))
    bench.controller.track(JointReference(0, bench.wanted, np.full(14, 5.0)))
    bench.controller.enter(TaskPhase(20 * _TICK_NS, 1, "second"))
    bench.controller.track(bench.reference(20 * _TICK_NS))
    effort = bench.answer(20 * _TICK_NS)
    np.testing.assert_array_equal(effort, bench.expected(NmpcGains(1.0, 0)))


def test_reset_repeats_the_run_bit_for_bit(bench: Bench) -> None:
    """Integral, phase and reference all go back to the start."""
    runs = []
    for _ in range(2):
        efforts = [bench.answer(0)]
        bench.controller.track(bench.reference(0))
        efforts += [bench.answer(tick * _TICK_NS) for tick in range(5)]
        bench.controller.enter(TaskPhase(5 * _TICK_NS, 1, "second"))
        efforts.append(bench.answer(5 * _TICK_NS))
        runs.append(np.array(efforts))
        bench.controller.reset()
    np.testing.assert_array_equal(runs[0], runs[1])


def test_an_unstable_phase_is_refused_before_the_run(robot: RobotModel, draw: Draw) -> None:
    """Also a later phase, which would be in force only after a while."""
    with pytest.raises(UnstableLoopError, match="derivative=9"):
        Bench(robot, draw, (PidGains(2.0, 1.0, 1.5), PidGains(2.0, 1.0, 9.0)))
