"""The closed-form NMPC law: its gains by least squares, its closed loop by its closed form."""

from fractions import Fraction
from math import factorial

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.nmpc import MAX_CONTROL_ORDER, NmpcGains, NmpcLaw, linearised
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.types import Array

from .conftest import Draw, slope, state_of

_EPS = np.finfo(float).eps
ORDERS = range(MAX_CONTROL_ORDER + 1)
RELATIVE_DEGREE = 2  # of joint positions: efforts act on the second derivative

# A1 T^2 and A2 T as published for this family of laws, order by order.
TABLE = {
    0: (Fraction(10, 3), Fraction(5, 2)),
    1: (Fraction(15), Fraction(6)),
    2: (Fraction(42), Fraction(21, 2)),
    3: (Fraction(280, 3), Fraction(16)),
}


def _first_row_of_solution(matrix: list[list[Fraction]], right: list[list[Fraction]]) -> list[Fraction]:
    """Return the first row of matrix^-1 right, exactly, by elimination from the last column."""
    rows = [list(a) + list(b) for a, b in zip(matrix, right, strict=True)]
    n = len(rows)
    for pivot in reversed(range(n)):
        scale = rows[pivot][pivot]
        rows[pivot] = [value / scale for value in rows[pivot]]
        for other in range(n):
            if other != pivot:
                factor = rows[other][pivot]
                pairs = zip(rows[other], rows[pivot], strict=True)
                rows[other] = [a - factor * b for a, b in pairs]
    return rows[0][n:]


def _optimal_gains(order: int) -> list[Fraction]:
    """Return A1 and A2 for T = 1 from the least-squares problem itself.

    The error is predicted by its Taylor series up to the derivative of order 2 + r; its integral
    square over the horizon is minimised over the derivatives 2 .. 2 + r, of which the first is used:
    e'' = -(first row of M_rr^-1 M_rp) (e, e') with M_ij = 1 / (i! j! (i + j + 1)).
    """

    def moment(i: int, j: int) -> Fraction:
        return Fraction(1, factorial(i) * factorial(j) * (i + j + 1))

    free = range(RELATIVE_DEGREE, RELATIVE_DEGREE + order + 1)
    quadratic = [[moment(i, j) for j in free] for i in free]
    linear = [[moment(i, j) for j in range(RELATIVE_DEGREE)] for i in free]
    return _first_row_of_solution(quadratic, linear)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("period", [0.1, 1.0, 2.0])
def test_gains_minimise_the_predicted_error(order: int, period: float) -> None:
    """The gains in the code, those published and those of the least-squares problem are the same numbers."""
    gains = NmpcGains(period, order)
    assert tuple(_optimal_gains(order)) == TABLE[order]
    position, velocity = TABLE[order]
    assert gains.position_gain == pytest.approx(float(position) / period**2, rel=8 * _EPS)
    assert gains.velocity_gain == pytest.approx(float(velocity) / period, rel=8 * _EPS)


@pytest.mark.parametrize("order", ORDERS)
def test_error_acceleration_is_what_the_law_asks_for(robot: RobotModel, draw: Draw, order: int) -> None:
    """Under the law the full robot has e'' = -A1 e - A2 e' at any state, with any desired motion."""
    gains = NmpcGains(1.3, order)
    law = NmpcLaw(robot, gains)
    for _ in range(10):
        q, v = draw.q(), draw.v()
        position, velocity = q[BASE_NQ:] + draw.vector(14, 0.01), v[BASE_NV:] + draw.vector(14, 0.1)
        desired = np.array([position, velocity, draw.vector(14, 0.1)])
        effort = law.effort(q, v, desired, 1e-3)
        assert np.all(np.abs(effort) < robot.effort_limit)
        found = pin.aba(robot.pin, robot.data, q, v, np.concatenate([np.zeros(BASE_NV), effort]))[BASE_NV:]
        error, rate = q[BASE_NQ:] - desired[0], v[BASE_NV:] - desired[1]
        expected = desired[2] - gains.position_gain * error - gains.velocity_gain * rate
        inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)
        scale = float(np.linalg.norm(expected) + np.linalg.norm(v) ** 2)
        np.testing.assert_allclose(found, expected, atol=20 * _EPS * np.linalg.cond(inertia) * scale)


def _response(gains: NmpcGains, time: float) -> tuple[float, float]:
    """Return e(t) and e'(t) of e'' + A2 e' + A1 e = 0 from e = 1, e' = 0: an underdamped oscillator."""
    decay = gains.velocity_gain / 2.0
    beat = np.sqrt(gains.position_gain - decay**2)
    fall = np.exp(-decay * time)
    e = fall * (np.cos(beat * time) + decay / beat * np.sin(beat * time))
    return float(e), float(-fall * gains.position_gain / beat * np.sin(beat * time))


def _sampled_departure(gains: NmpcGains, tick: float, count: int) -> float:
    """Return how far the same oscillator strays when its acceleration is held over each tick."""
    a1, a2 = gains.position_gain, gains.velocity_gain
    step = np.array([[1.0 - a1 * tick**2 / 2.0, tick - a2 * tick**2 / 2.0], [-a1 * tick, 1.0 - a2 * tick]])
    error, worst = np.array([1.0, 0.0]), 0.0
    for index in range(count):
        error = step @ error
        worst = max(worst, float(np.max(np.abs(error - _response(gains, (index + 1) * tick)))))
    return worst


@pytest.mark.parametrize("order", ORDERS)
def test_closed_loop_follows_its_closed_form(robot: RobotModel, draw: Draw, order: int) -> None:
    """Every joint error of the nonlinear, free-floating robot follows the same oscillator.

    It departs only because it is sampled: as far as a plain double integrator does under the same
    sampled law, and with the first power of the tick, to nothing.
    """
    gains = NmpcGains(1.0, order)
    law = NmpcLaw(robot, gains)
    q0 = robot.configuration(draw.pose(), np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2))
    error = draw.vector(14, 0.05)
    desired = np.array([q0[BASE_NQ:] - error, np.zeros(14), np.zeros(14)])
    time, ticks, departures = 1.0, [0.002, 0.004, 0.008], []
    for tick in ticks:
        q, v = q0, np.zeros(20)
        integrator = LieGroupIntegrator(robot.pin, TABLEAUS["rk4"], tick)
        worst = 0.0
        for index in range(round(time / tick)):
            effort = law.effort(q, v, desired, tick)
            assert np.all(np.abs(effort) < robot.effort_limit)
            generalized = np.concatenate([np.zeros(BASE_NV), effort])

            def acceleration(q: Array, v: Array, u: Array = generalized) -> Array:
                return np.array(pin.aba(robot.pin, robot.data, q, v, u))

            q, v = integrator.step(acceleration, q, v)
            e, rate = _response(gains, (index + 1) * tick)
            worst = max(
                worst,
                float(np.max(np.abs(q[BASE_NQ:] - desired[0] - e * error))),
                float(np.max(np.abs(v[BASE_NV:] - rate * error))),
            )
        departures.append(worst)
    sampled = _sampled_departure(gains, ticks[0], round(time / ticks[0])) * float(np.max(np.abs(error)))
    assert departures[0] == pytest.approx(sampled, rel=0.01)  # velocity terms: 0.05 rad squared
    assert slope(ticks, departures) == pytest.approx(1.0, abs=0.1)


def test_a_constant_disturbance_leaves_a_static_error(robot: RobotModel, draw: Draw) -> None:
    """The law has no integral: an effort d is balanced where e = 0.3 T^2 H*^-1 d, for order 0."""
    period = 1.5
    q = draw.q()
    disturbance = draw.vector(14, 0.1)
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    error = 0.3 * period**2 * np.linalg.solve(inertia, disturbance)
    desired = np.array([q[BASE_NQ:] - error, np.zeros(14), np.zeros(14)])
    effort = NmpcLaw(robot, NmpcGains(period, 0)).effort(q, np.zeros(20), desired, 1e-3)
    bound = 20 * _EPS * float(np.linalg.cond(inertia))
    np.testing.assert_allclose(effort, -disturbance, atol=bound)


def test_efforts_keep_to_what_the_joints_can_give(robot: RobotModel, draw: Draw) -> None:
    """However large the error, no joint is asked for more than its limit."""
    q = draw.q()
    desired = np.array([q[BASE_NQ:] + 500.0, np.zeros(14), np.zeros(14)])
    effort = NmpcLaw(robot, NmpcGains(0.1, 3)).effort(q, np.zeros(20), desired, 1e-3)
    assert np.all(np.abs(effort) <= robot.effort_limit)
    assert np.any(np.abs(effort) == robot.effort_limit)


def test_new_gains_act_at_once_and_nothing_is_remembered(robot: RobotModel, draw: Draw) -> None:
    """A law that went on to other gains is the same as one that began with them."""
    q, v = draw.q(), draw.v(0.1)
    desired = np.array([q[BASE_NQ:] + 0.01, np.zeros(14), np.zeros(14)])
    law, fresh = NmpcLaw(robot, NmpcGains(1.0, 0)), NmpcLaw(robot, NmpcGains(2.0, 1))
    law.effort(q, v, desired, 1e-3)
    law.use(NmpcGains(2.0, 1))
    np.testing.assert_array_equal(law.effort(q, v, desired, 1e-3), fresh.effort(q, v, desired, 1e-3))
    assert law.memory.size == 0


def test_linearised_gains_are_the_derivatives_of_the_effort(robot: RobotModel, draw: Draw) -> None:
    """At rest the efforts are -(A1 H* e + A2 H* e'), which is exact since the law is linear in the error."""
    q = draw.q()
    state = state_of(robot, q, np.zeros(20))
    law = NmpcLaw(robot, NmpcGains(0.7, 2))
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    feedback = linearised(NmpcGains(0.7, 2), inertia)
    assert not np.any(feedback.integral)
    e, rate = draw.vector(14, 0.01), draw.vector(14, 0.01)
    desired = np.array([state.joint_position - e, -rate, np.zeros(14)])
    expected = -(feedback.position @ e + feedback.velocity @ rate)
    rounding = 100 * 14 * _EPS  # gains below 100 on numbers below 10 that were subtracted
    np.testing.assert_allclose(law.effort(state.q, state.v, desired, 1e-3), expected, atol=rounding)
