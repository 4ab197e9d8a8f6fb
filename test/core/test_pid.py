"""The PID law against an independent linear simulation, at its limits, and across a change of gains."""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.pid import PidGains, PidLaw, linearised
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.types import Array

from .conftest import Draw, slope, state_of

_EPS = np.finfo(float).eps
_GAINS = PidGains(2.0, 1.0, 1.5)
_DT = 1e-3  # [s]
_BENT = np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2)  # [rad]


def _mode(inertia: float, gains: PidGains, error: float, count: int) -> Array:
    """Return e, e' of one mode after each tick, (count, 2), from the eigenvectors of its own 3 x 3 matrix.

    A mass with the same three gains: (e, e', z) with the effort held over the tick, by hand.
    """
    pull = np.array([gains.proportional, gains.derivative, gains.integral]) / inertia
    matrix = np.array([[1.0, _DT, 0.0], [0.0, 1.0, 0.0], [_DT, 0.0, 1.0]])
    matrix[0] -= 0.5 * _DT**2 * pull
    matrix[1] -= _DT * pull
    values, vectors = np.linalg.eig(matrix)
    weights = np.linalg.solve(vectors, np.array([error, 0.0, 0.0]))
    powers = values[None, :] ** np.arange(1, count + 1)[:, None]
    return np.asarray(((powers * weights) @ vectors.T).real[:, :2])


def _linear(inertia: Array, gains: PidGains, error: Array, count: int) -> tuple[Array, Array]:
    """Return errors and rates (count, n) of the frozen robot: every mode of the inertia by itself."""
    moments, modes = np.linalg.eigh(inertia)
    shares = modes.T @ error
    each = [_mode(moment, gains, share, count) for moment, share in zip(moments, shares, strict=True)]
    stacked = np.stack(each)  # mode, tick, (e, e')
    return np.asarray(stacked[:, :, 0].T @ modes.T), np.asarray(stacked[:, :, 1].T @ modes.T)


def test_law_on_a_frozen_robot_equals_the_linear_simulation(robot: RobotModel, draw: Draw) -> None:
    """With a constant inertia the law gives, tick by tick, what the modes give each by itself."""
    q = robot.configuration(draw.pose(), _BENT)
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    law = PidLaw(robot, _GAINS)
    e, rate, count = draw.vector(14, 0.1), np.zeros(14), 3000
    desired = np.array([_BENT, np.zeros(14), np.zeros(14)])
    expected, expected_rate = _linear(inertia, _GAINS, e, count)
    for tick in range(count):
        v = np.concatenate([np.zeros(BASE_NV), rate])
        effort = law.effort(np.concatenate([q[:BASE_NQ], _BENT + e]), v, desired, _DT)
        acceleration = np.linalg.solve(inertia, effort)
        e = e + _DT * rate + 0.5 * _DT**2 * acceleration
        rate = rate + _DT * acceleration
        # rounding of q = q_d + e (numbers below 3) fed back each tick through accelerations of 1 / 1e-3
        bound = (tick + 1) * 3.0 * _EPS * 10.0
        np.testing.assert_allclose(e, expected[tick], atol=bound)
        np.testing.assert_allclose(rate, expected_rate[tick], atol=100 * bound)


def test_small_motions_of_the_robot_are_those_of_the_frozen_one(robot: RobotModel, draw: Draw) -> None:
    """The free-floating robot departs from the frozen model with the square of the error, to nothing."""
    q0 = robot.configuration(draw.pose(), _BENT)
    inertia = reduced_dynamics(robot, q0, np.zeros(20)).inertia
    direction = draw.vector(14)
    count, sizes, departures = 400, [0.0025, 0.005, 0.01], []
    for size in sizes:
        law = PidLaw(robot, _GAINS)
        error = size * direction
        desired = np.array([_BENT - error, np.zeros(14), np.zeros(14)])
        expected, _ = _linear(inertia, _GAINS, error, count)
        q, v, worst = q0, np.zeros(20), 0.0
        integrator = LieGroupIntegrator(robot.pin, TABLEAUS["rk4"], _DT)
        for tick in range(count):
            effort = law.effort(q, v, desired, _DT)
            generalized = np.concatenate([np.zeros(BASE_NV), effort])

            def acceleration(q: Array, v: Array, u: Array = generalized) -> Array:
                return np.array(pin.aba(robot.pin, robot.data, q, v, u))

            q, v = integrator.step(acceleration, q, v)
            worst = max(worst, float(np.max(np.abs(q[BASE_NQ:] - desired[0] - expected[tick]))))
        departures.append(worst)
    assert slope(sizes, departures) == pytest.approx(2.0, abs=0.1)


class Bench:
    """A law fed with errors of one joint by hand."""

    def __init__(self, robot: RobotModel, gains: PidGains = _GAINS) -> None:
        """Put joint 2 of arm A on the bench."""
        self.robot = robot
        self.law = PidLaw(robot, gains)
        self.joint = 1
        self.limit = float(robot.effort_limit[self.joint])

    def step(self, error: float, rate: float = 0.0, dt: float = _DT) -> float:
        """Return the effort that answers an error and its rate."""
        q, v = np.zeros(21), np.zeros(20)
        q[6] = 1.0
        q[BASE_NQ + self.joint], v[BASE_NV + self.joint] = error, rate
        desired = np.array([np.zeros(14), np.zeros(14), np.zeros(14)])
        effort = self.law.effort(q, v, desired, dt)
        assert np.count_nonzero(np.delete(effort, self.joint)) == 0
        return float(effort[self.joint])

    @property
    def integral_effort(self) -> float:
        """The effort without error: that of the integral alone."""
        return self.step(0.0)


def test_each_term_pushes_against_its_error(robot: RobotModel) -> None:
    """The effort is u = -(K_P e + K_I z + K_D e') with e = q - q_d, and z the sum of the errors before."""
    bench = Bench(robot)
    assert bench.step(0.1) == pytest.approx(-0.2, rel=4 * _EPS)  # the integral is still empty
    assert bench.step(0.0, rate=0.2) == pytest.approx(-(1.0 * 0.1 * _DT + 1.5 * 0.2), rel=4 * _EPS)
    for _ in range(10):
        bench.step(0.1)
    assert bench.integral_effort == pytest.approx(-11 * 0.1 * _DT, rel=32 * _EPS)


def test_the_integral_counts_simulated_time(robot: RobotModel) -> None:
    """One tick of 10 ms integrates as much as ten of 1 ms."""
    short, long = Bench(robot), Bench(robot)
    for _ in range(10):
        short.step(0.1, dt=1e-3)
    long.step(0.1, dt=1e-2)
    assert short.integral_effort == pytest.approx(long.integral_effort, rel=16 * _EPS)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_integral_does_not_wind_up_at_the_limit(robot: RobotModel, sign: float) -> None:
    """While an error holds a joint at its effort limit, nothing adds up that would have to be undone."""
    bench = Bench(robot)
    bench.step(sign * 1.0)
    before = bench.integral_effort
    for _ in range(1000):
        assert bench.step(sign * 100.0) == -sign * bench.limit
    assert bench.integral_effort == before


def test_the_integral_unwinds_at_the_limit(robot: RobotModel) -> None:
    """An error that leads away from the limit is integrated even while the joint is still at it."""
    bench = Bench(robot)
    for _ in range(10):
        assert bench.step(-0.1, rate=1000.0) == -bench.limit  # at the lower limit by its rate alone
    assert bench.integral_effort == pytest.approx(10 * 0.1 * _DT, rel=32 * _EPS)


def test_a_saturated_joint_does_not_stop_the_others(robot: RobotModel, draw: Draw) -> None:
    """Anti-windup is a matter of each joint by itself."""
    law = PidLaw(robot, _GAINS)
    q = robot.configuration(draw.pose(), np.zeros(14))
    at_rest = state_of(robot, q, np.zeros(20))
    errors = np.zeros(14)
    errors[0], errors[5] = 100.0, 0.1
    law.effort(at_rest.q, at_rest.v, np.array([-errors, np.zeros(14), np.zeros(14)]), _DT)
    effort = law.effort(at_rest.q, at_rest.v, np.array([np.zeros(14), np.zeros(14), np.zeros(14)]), _DT)
    expected = np.zeros(14)
    expected[5] = -0.1 * _DT
    np.testing.assert_allclose(effort, expected, atol=_EPS)


def test_a_constant_disturbance_is_integrated_away(robot: RobotModel) -> None:
    """The integral ends where it balances an effort from outside: no static error remains."""
    disturbance, inertia, dt = 0.5, 1.0, 1e-2  # [N m], [kg m^2], [s]
    bench = Bench(robot)
    e, rate = 0.0, 0.0
    slowest = max(np.roots([inertia, 1.5, 2.0, 1.0]).real)  # [1/s] of the closed loop
    for _ in range(round(-30.0 / slowest / dt)):  # e^-30 is far below the bound
        acceleration = (bench.step(e, rate, dt) + disturbance) / inertia
        e, rate = e + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
    assert abs(e) < 1e-12
    assert bench.integral_effort == pytest.approx(-disturbance, abs=1e-12)


def test_new_gains_do_not_kick(robot: RobotModel) -> None:
    """When the integral gain changes, the integral effort goes on without a jump."""
    bench = Bench(robot)
    for _ in range(100):
        bench.step(0.3)
    before = bench.integral_effort
    bench.law.use(PidGains(5.0, 4.0, 0.1))
    assert bench.integral_effort == pytest.approx(before, rel=4 * _EPS)
    assert bench.step(0.1) == pytest.approx(before - 0.5, rel=4 * _EPS)
    bench.law.use(PidGains(5.0, 0.0, 0.1))
    assert bench.integral_effort == 0.0  # without integral action there is nothing to carry on


def test_the_integral_is_all_that_is_remembered(robot: RobotModel) -> None:
    """Restored, the law answers as it did; from an empty memory it is as new."""
    bench, other = Bench(robot), Bench(robot)
    bench.step(0.3)
    other.law.restore(bench.law.memory)
    assert other.integral_effort == bench.integral_effort != 0.0
    bench.law.restore(np.zeros(0))
    assert bench.integral_effort == 0.0


def test_linearised_gains_are_those_of_every_joint() -> None:
    """Three diagonal matrices, whatever the inertia."""
    feedback = linearised(_GAINS, np.ones((14, 14)))
    np.testing.assert_array_equal(feedback.position, 2.0 * np.eye(14))
    np.testing.assert_array_equal(feedback.velocity, 1.5 * np.eye(14))
    np.testing.assert_array_equal(feedback.integral, 1.0 * np.eye(14))
