"""The verdict on gains and tick, computed before anything moves, against brute-force simulation."""

import numpy as np
import pytest

from sms_handover.control import nmpc, pid
from sms_handover.control.law import LinearFeedback
from sms_handover.control.nmpc import NmpcGains, NmpcLaw
from sms_handover.control.pid import PID, PidGains, PidLaw
from sms_handover.control.stability import check_stability, loop_stability, sampled_loop
from sms_handover.errors import UnstableLoopError
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NQ, RobotModel
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.wiring import make_controller
from sms_handover.types import Array

from .conftest import Draw, Gains, law_of, state_of

_EPS = np.finfo(float).eps
_BENT = np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2)  # [rad]
_PID = PidGains(2.0, 1.0, 1.5)


@pytest.fixture(scope="module")
def q(robot: RobotModel) -> Array:
    """A configuration away from singular ones."""
    base = np.array([0.3, -0.1, 0.2, 0.5, -0.5, 0.5, 0.5])
    return np.concatenate([base, _BENT])


@pytest.fixture(scope="module")
def inertia(robot: RobotModel, q: Array) -> Array:
    """Its reduced inertia."""
    return reduced_dynamics(robot, q, np.zeros(20)).inertia


def linearised(gains: Gains, inertia: Array) -> LinearFeedback:
    """Return the feedback at rest of the law of some gains."""
    return nmpc.linearised(gains, inertia) if isinstance(gains, NmpcGains) else pid.linearised(gains, inertia)


def _tick(robot: RobotModel, law: NmpcLaw | PidLaw, inertia: Array, q: Array, x: Array, dt: float) -> Array:
    """Return (e, e') after one tick of the law itself on the frozen robot, started at rest elsewhere."""
    n = robot.n_joints
    e, rate = x[:n], x[n : 2 * n]
    state = state_of(robot, q, np.zeros(20))
    desired = np.array([q[BASE_NQ:] - e, -rate, np.zeros(n)])
    acceleration = np.linalg.solve(inertia, law.effort(state.q, state.v, desired, dt))
    return np.concatenate([e + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration])


def _growth(robot: RobotModel, gains: Gains, inertia: Array, q: Array, dt: float, start: Array) -> float:
    """Return the growth per tick of a motion simulated by brute force, once its fastest mode prevails."""
    law, x = law_of(robot, gains), start * 1e-6
    logs = []
    for _ in range(4000):
        x = _tick(robot, law, inertia, q, x, dt)
        size = float(np.linalg.norm(x))
        logs.append(np.log(size))
        if not 1e-12 < size < 1e-2:  # errors are differences of angles: below is rounding, above the limits
            break
    settled = len(logs) // 2
    return float(np.exp((logs[-1] - logs[settled]) / (len(logs) - 1 - settled)))


@pytest.mark.parametrize("gains", [NmpcGains(1.0, 0), NmpcGains(0.5, 2), PidGains(2.0, 0.0, 1.5)])
@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_transition_is_what_one_tick_does(
    robot: RobotModel, inertia: Array, q: Array, gains: Gains, dt: float
) -> None:
    """Column by column, the matrix has what the law itself does to a unit error over one tick."""
    matrix = sampled_loop(inertia, linearised(gains, inertia), dt)
    assert matrix.shape == (28, 28)
    for column, unit in enumerate(1e-3 * np.eye(28)):
        found = _tick(robot, law_of(robot, gains), inertia, q, unit, dt) / 1e-3
        # errors are differences of angles below 3 rad: eps over 1e-3, through gains over inertias
        scale = max(1.0, float(np.max(np.abs(matrix))))
        np.testing.assert_allclose(found, matrix[:, column], atol=1e3 * 3.0 * _EPS * scale * 14)


def test_transition_with_integral_is_what_two_ticks_do(robot: RobotModel, inertia: Array, q: Array) -> None:
    """The integral acts from the next tick on, with the error of this one."""
    matrix = sampled_loop(inertia, pid.linearised(_PID, inertia), 1e-3)
    assert matrix.shape == (42, 42)
    law, x = law_of(robot, _PID), np.zeros(42)
    x[3] = 1e-3
    expected = matrix @ (matrix @ x)
    for _ in range(2):
        x = np.concatenate([_tick(robot, law, inertia, q, x, 1e-3), x[28:] + 1e-3 * x[:14]])
    # as above, with the law's own integral in the second tick
    np.testing.assert_allclose(x, expected, atol=3.0 * _EPS * 14 * float(np.max(np.abs(matrix))) ** 2)


@pytest.mark.parametrize(
    ("gains", "dt", "stable"),
    [
        (_PID, 1e-3, True),
        (_PID, 2e-3, False),
        (PidGains(20.0, 1.0, 1.5), 1e-3, True),
        (PidGains(2.0, 1.0, 2.5), 1e-3, False),
        (PidGains(200.0, 0.0, 0.0), 1e-3, False),  # without damping a sampled loop grows
        (NmpcGains(1.0, 0), 1e-3, True),
        (NmpcGains(1.0, 0), 0.79, True),
        (NmpcGains(1.0, 0), 0.81, False),
        (NmpcGains(1.2e-3, 0), 1e-3, False),
    ],
)
def test_verdict_agrees_with_brute_force(
    robot: RobotModel, inertia: Array, q: Array, draw: Draw, gains: Gains, dt: float, stable: bool
) -> None:
    """The law is simulated tick by tick on the frozen robot: it dies out or grows, as the verdict says.

    Where it grows, it does so at the rate of the spectral radius.
    """
    feedback = linearised(gains, inertia)
    found = loop_stability(inertia, feedback, dt, robot.joint_names)
    assert found.stable is stable
    growth = _growth(robot, gains, inertia, q, dt, draw.vector(28))
    assert (growth < 1.0) is stable
    if not stable and found.spectral_radius < 2.0:
        assert growth == pytest.approx(found.spectral_radius, rel=0.02)


@pytest.mark.parametrize(("order", "longest"), [(0, 4 / 5), (1, 1 / 3), (2, 4 / 21), (3, 1 / 8)])
def test_longest_tick_of_nmpc_is_that_of_a_double_integrator(
    robot: RobotModel, inertia: Array, order: int, longest: float
) -> None:
    """A sampled double integrator with gains A1, A2 is stable for h < 2 / A2: 4 T / ((r+1)(r+5))."""
    gains = NmpcGains(1.5, order)
    feedback = linearised(gains, inertia)
    for share, stable in ((0.999, True), (1.001, False)):
        tick = share * longest * gains.rolling_period
        assert loop_stability(inertia, feedback, tick, robot.joint_names).stable is stable


def test_the_joint_that_diverges_is_named(robot: RobotModel) -> None:
    """With a diagonal inertia the lightest joint is the first to go."""
    moments = np.full(14, 0.5)
    moments[9] = 1e-3
    feedback = pid.linearised(_PID, np.diag(moments))
    found = loop_stability(np.diag(moments), feedback, 2e-3, robot.joint_names)
    assert (found.stable, found.joint) == (False, robot.joint_names[9])


def test_a_loop_without_gains_is_not_stable(inertia: Array, robot: RobotModel) -> None:
    """Joints that drift on for ever do not decay, so that is refused too."""
    nothing = LinearFeedback(0.0 * inertia, 0.0 * inertia, 0.0 * inertia)
    assert not loop_stability(inertia, nothing, 1e-3, robot.joint_names).stable


def test_every_gain_set_is_checked(robot: RobotModel, q: Array) -> None:
    """One bad phase among good ones is enough; the message has gains, tick, radius and joint on one line."""
    good, bad = PidGains(2.0, 1.0, 1.5), PidGains(2.0, 1.0, 9.0)
    assert [found.stable for found in check_stability(PID, robot, [good, good], 1e-3, q)] == [True, True]
    with pytest.raises(UnstableLoopError) as caught:
        check_stability(PID, robot, [good, bad], 1e-3, q)
    text = str(caught.value)
    assert "derivative=9.0" in text and "0.001 s" in text and "joint_" in text and "\n" not in text


# --- the shipped scenario ------------------------------------------------------------------------


def _start(scenario: Scenario) -> None:
    """Make the controller of a scenario, which checks its loop."""
    common, parameters = scenario.parameters.common, scenario.parameters.controller
    make_controller(scenario.truth.robot, scenario.truth.schedule, common, parameters)


def test_pid_at_2_ms_is_refused_because_of_a_joint_7() -> None:
    """The derivative gain on the lightest joint: K_D dt / I is 1.4 at 1 ms, and must stay below 2."""
    _start(load_scenario("colliding", {"common": {"tick": 0.001}, "controller": {"law": "pid"}}))
    slower = load_scenario("colliding", {"common": {"tick": 0.002}, "controller": {"law": "pid"}})
    with pytest.raises(UnstableLoopError, match=r"0\.002 s is unstable.*first at arm_[ab]_joint_7; use a"):
        _start(slower)


def test_a_mass_is_judged_in_the_hand_where_it_is_carried() -> None:
    """At the start nothing is carried, and a stretched arm is another one than that which will carry it."""
    _start(load_scenario("paper", {"law": "pid", "deputy.mass": 2.0}))
    with pytest.raises(UnstableLoopError, match=r"where phase 'carry' ends with the 12 kg .* in arm_a"):
        check_scenario(load_scenario("massive", {"law": "pid"}))


def test_nmpc_at_10_ms_is_accepted() -> None:
    """Its gains scale with the inertia, so its tick is bound by the horizon alone."""
    _start(load_scenario("colliding", {"common": {"tick": 0.01}, "controller": {"law": "nmpc"}}))


def test_the_shipped_phases_are_all_stable(scenario: Scenario) -> None:
    """Both laws may run as shipped."""
    _start(scenario)
