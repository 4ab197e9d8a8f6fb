"""Control laws against closed forms and linear simulations.

Under NMPC the errors of a nonlinear, free-floating robot obey e'' + A2 e' + A1 e = 0; under PID they
obey, for small errors, the linear equations of the robot frozen in one configuration.
"""

from dataclasses import replace
from math import exp, factorial

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.nmpc import MAX_CONTROL_ORDER, NmpcGains, NmpcLaw
from sms_handover.control.pid import PidGains, PidLaw
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.plant.plant_state import InitialState
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import Array, Pose
from test.core.conftest import Draw, slope
from test.core.test_pid import Bench, _linear
from test.evidence import Record, Table
from test.verification.lagrangian import Lagrangian, pinocchio_configuration

_EPS = float(np.finfo(float).eps)
_TICK = 1e-3  # [s]
_BENT = np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2)  # [rad] well inside every limit
_PERIODS = (0.5, 1.0, 2.0)  # [s] rolling periods
_ORDERS = range(MAX_CONTROL_ORDER + 1)
_PID = PidGains(2.0, 1.0, 1.5)  # the paper's

Law = NmpcLaw | PidLaw


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture
def draw(robot: RobotModel) -> Draw:
    """Random states, the same in every run of a test."""
    return Draw(robot, seed=20)


def _at_rest(position: Array) -> Array:
    """Return a desired motion that stands still."""
    return np.array([position, np.zeros(14), np.zeros(14)])


def _balanced_cond(inertia: Array) -> float:
    """Return cond(H*) with every joint given the same weight."""
    weights = 1.0 / np.sqrt(np.diag(inertia))
    return float(np.linalg.cond(weights[:, None] * inertia * weights))


def _oscillator(gains: NmpcGains, time: Array, error: Array, rate: Array) -> Array:
    """Return e(t) (times, n) of e'' + A2 e' + A1 e = 0: an underdamped oscillator for every order."""
    decay = gains.velocity_gain / 2.0
    beat = np.sqrt(gains.position_gain - decay**2)
    cosine, sine = np.cos(beat * time)[:, None], np.sin(beat * time)[:, None]
    return np.asarray(
        np.exp(-decay * time)[:, None] * (cosine * error + sine / beat * (rate + decay * error))
    )


def _rk4_oscillator(gains: NmpcGains, count: int, error: Array, rate: Array) -> Array:
    """Return e (count + 1, n) of the same oscillator by the classical Runge-Kutta scheme at the tick."""
    matrix = _TICK * np.array([[0.0, 1.0], [-gains.position_gain, -gains.velocity_gain]])
    step = sum(np.linalg.matrix_power(matrix, k) / factorial(k) for k in range(5))
    found = [np.vstack([error, rate])]
    for _ in range(count):
        found.append(step @ found[-1])
    return np.array(found)[:, 0]


def _held_oscillator(gains: NmpcGains, count: int, error: Array, rate: Array) -> Array:
    """Return e (count + 1, n) of the same oscillator with its acceleration held over each tick."""
    a1, a2, h = gains.position_gain, gains.velocity_gain, _TICK
    step = np.array([[1.0 - a1 * h**2 / 2.0, h - a2 * h**2 / 2.0], [-a1 * h, 1.0 - a2 * h]])
    found = [np.vstack([error, rate])]
    for _ in range(count):
        found.append(step @ found[-1])
    return np.array(found)[:, 0]


def _closed_loop(
    robot: RobotModel, law: Law, desired: Array, q: Array, v: Array, count: int, *, held: bool
) -> Array:
    """Return the joint errors (count + 1, n); ``held`` holds the efforts over each tick, else they follow."""

    def effort_at(q: Array, v: Array) -> Array:
        effort = law.effort(q, v, desired, _TICK)
        assert np.all(np.abs(effort) < robot.effort_limit)
        return np.concatenate([np.zeros(BASE_NV), effort])

    integrator = LieGroupIntegrator(robot.pin, TABLEAUS["rk4"], _TICK)
    errors = [q[BASE_NQ:] - desired[0]]
    for _ in range(count):
        command = effort_at(q, v)

        def acceleration(q: Array, v: Array, command: Array = command) -> Array:
            return np.array(pin.aba(robot.pin, robot.data, q, v, command if held else effort_at(q, v)))

        q, v = integrator.step(acceleration, q, v)
        errors.append(q[BASE_NQ:] - desired[0])
    return np.array(errors)


@pytest.mark.parametrize("order", _ORDERS)
@pytest.mark.parametrize("period", _PERIODS)
def test_nmpc_response(robot: RobotModel, draw: Draw, period: float, order: int, record: Record) -> None:
    """From a perturbed start, with a tumbling base, every joint error follows the closed-form response.

    With efforts that follow the state the only difference is the integrator's, the same as for the
    oscillator alone. With efforts held over 1 ms the oscillator with its acceleration held tells how
    much that changes; from rest, so that the robot itself changes little within a tick.
    """
    gains = NmpcGains(period, order)
    q = robot.configuration(draw.pose(), _BENT)
    v, rest = draw.v(0.1), np.zeros(20)
    error = draw.vector(14, 0.05)
    desired = _at_rest(_BENT - error)
    count = round(2.0 * period / (order + 1) / _TICK)
    time: Array = _TICK * np.arange(count + 1, dtype=np.float64)
    exact = _oscillator(gains, time, error, v[BASE_NV:])
    about = f"NMPC, order {order}, T_r = {period:g} s: largest joint error off the closed form"

    found = _closed_loop(robot, NmpcLaw(robot, gains), desired, q, v, count, held=False)
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    truncation = float(np.max(np.abs(_rk4_oscillator(gains, count, error, v[BASE_NV:]) - exact)))
    rounding = 20 * _EPS * _balanced_cond(inertia)  # relative to accelerations, so to errors
    off = float(np.max(np.abs(found - exact)))
    against = "e'' + A2 e' + A1 e = 0 in closed form"
    record(f"{about}, efforts following", off, truncation + rounding, unit="rad", against=against)

    found = _closed_loop(robot, NmpcLaw(robot, gains), desired, q, rest, count, held=True)
    exact = _oscillator(gains, time, error, rest[BASE_NV:])
    held = float(np.max(np.abs(_held_oscillator(gains, count, error, rest[BASE_NV:]) - exact)))
    off = float(np.max(np.abs(found - exact)))
    record(f"{about}, efforts held over 1 ms", off, 1.05 * held, unit="rad", against=against)


def test_nmpc_effort(robot: RobotModel, draw: Draw, record: Record) -> None:
    """The law is u = H* (q_d'' - A1 e - A2 e') + c*, with H* and c* from Lagrange's equations."""
    lagrangian = Lagrangian(robot.description)
    gains = NmpcGains(1.0, 0)
    law, worst, cond = NmpcLaw(robot, gains), 0.0, 0.0
    for _ in range(20):
        euler = np.concatenate([draw.vector(6), draw.joints()])
        q, v = pinocchio_configuration(euler), draw.v()
        error, rate, wanted = draw.vector(14, 0.1), draw.vector(14, 0.1), draw.vector(14, 0.1)
        desired = np.array([q[BASE_NQ:] - error, v[BASE_NV:] - rate, wanted])
        motion = lagrangian.motion(euler, v)
        inverse = np.linalg.inv(motion.inertia)
        inertia = np.linalg.inv(inverse[BASE_NV:, BASE_NV:])
        pulled = wanted - gains.position_gain * error - gains.velocity_gain * rate
        expected = inertia @ (pulled + (inverse @ motion.bias)[BASE_NV:])
        weights = 1.0 / np.sqrt(np.diag(inertia))
        found = law.effort(q, v, desired, _TICK)
        off = np.linalg.norm((found - expected) * weights) / np.linalg.norm(expected * weights)
        worst, cond = max(worst, float(off)), max(cond, _balanced_cond(motion.inertia))
    claim = "NMPC efforts, relative, 20 states"
    record(claim, worst, 120 * _EPS * cond, against="H* and c* of the Lagrangian, CasADi")


@pytest.mark.parametrize("period", [0.5, 1.0])
def test_static_error(robot: RobotModel, draw: Draw, period: float, record: Record) -> None:
    """A constant torque d at the joints, which no integral answers, is balanced at e = 0.3 T_r^2 H*^-1 d."""
    base = draw.pose()
    inertia = reduced_dynamics(robot, robot.configuration(base, _BENT), np.zeros(20)).inertia
    disturbance = inertia @ draw.vector(14, 0.2)  # 0.2 rad/s^2 on every joint
    nowhere = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    start = InitialState(base, _BENT, nowhere, {})
    parameters = replace(load_parameters().plant, integrator="rk4")
    plant = FreeFloatingPlant(robot, parameters, start, 1_000_000)
    law, desired = NmpcLaw(robot, NmpcGains(period, 0)), _at_rest(_BENT)
    decays = 30.0
    # Modes decay as exp(-1.25 t / T_r) but for H*^-1 d changing with q, which costs up to half.
    for _ in range(round(2.0 * decays * period / 1.25 / _TICK)):
        effort = law.effort(plant.q, plant.v, desired, _TICK) + disturbance
        plant.apply(effort)
    state = plant.state
    assert not any(plant.saturated_ticks.values())
    inertia = reduced_dynamics(robot, state.q, np.zeros(20)).inertia
    expected = 0.3 * period**2 * np.linalg.solve(inertia, disturbance)
    found = state.joint_position - _BENT
    off = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
    bound = 10.0 * exp(-decays) + 20 * _EPS * float(np.linalg.cond(inertia))
    claim = f"NMPC, order 0, T_r = {period:g} s: static error under a constant torque, relative"
    record(claim, off, bound, against="0.3 T_r^2 H*^-1 d")


def _sensitivity(matrix: Array, right: Array, solution: Array) -> float:
    """Return by how much least squares enlarge rounding: cond + cond^2 |residual| / (|matrix| |solution|)."""
    cond = float(np.linalg.cond(matrix))
    misfit = np.linalg.norm(matrix @ solution - right, axis=0) / np.linalg.norm(solution, axis=0)
    return cond + cond**2 * float(np.max(misfit)) / float(np.linalg.norm(matrix, 2))


@pytest.mark.parametrize("order", _ORDERS)
def test_gains_from_the_least_squares_problem(order: int, record: Record) -> None:
    """The gains minimise the predicted error over the horizon, its integral taken by Gauss and Legendre.

    e(t + s) = sum of s^k/k! e^(k) up to k = 2 + r; what is free are the derivatives from the second on,
    and the second is applied.
    """
    points, weights = np.polynomial.legendre.leggauss(order + 3)  # exact up to degree 2 r + 5 >= 2 (2 + r)
    worst, bound = 0.0, 0.0
    for period in _PERIODS:
        s = period / 2.0 * (points + 1.0)
        columns = np.array([np.sqrt(weights) * s**k / factorial(k) for k in range(order + 3)]).T
        scale = np.array([period**k for k in range(order + 3)])  # makes every column about as large
        columns = columns / scale
        solution, *_ = np.linalg.lstsq(columns[:, 2:], -columns[:, :2], rcond=None)
        found = -solution[0] * scale[:2] / scale[2]
        gains = NmpcGains(period, order)
        expected = np.array([gains.position_gain, gains.velocity_gain])
        worst = max(worst, float(np.max(np.abs(found / expected - 1.0))))
        bound = max(bound, 10 * _EPS * _sensitivity(columns[:, 2:], -columns[:, :2], solution))
    claim = f"gains A1 and A2 for order {order}, T_r = 0.5, 1, 2 s, relative"
    record(claim, worst, bound, against="least-squares problem, Gauss-Legendre")


def test_pid_on_the_frozen_robot(robot: RobotModel, draw: Draw, record: Record) -> None:
    """With a constant inertia the law gives, tick by tick, what every mode gives by itself."""
    q = robot.configuration(draw.pose(), _BENT)
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    law, count = PidLaw(robot, _PID), 5000
    e, rate = draw.vector(14, 0.1), np.zeros(14)
    expected, _ = _linear(inertia, _PID, e, count)
    worst = 0.0
    for tick in range(count):
        v = np.concatenate([np.zeros(BASE_NV), rate])
        moved = np.concatenate([q[:BASE_NQ], _BENT + e])
        effort = law.effort(moved, v, _at_rest(_BENT), _TICK)
        acceleration = np.linalg.solve(inertia, effort)
        e = e + _TICK * rate + 0.5 * _TICK**2 * acceleration
        rate = rate + _TICK * acceleration
        worst = max(worst, float(np.max(np.abs(e - expected[tick]))))
    bound = count * 3.0 * _EPS * 10.0  # q = q_d + e rounds at 3 rad; fed back by 1 / 1e-3 over 1e-2 s
    claim = "PID on the frozen robot, 5 s: largest joint error off the linear simulation"
    record(claim, worst, bound, unit="rad", against="modes of the inertia, one by one")


def test_pid_on_the_free_robot(robot: RobotModel, draw: Draw, record: Record) -> None:
    """The free-floating robot departs from the frozen one with the square of the error, to nothing."""
    q = robot.configuration(draw.pose(), _BENT)
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    direction, count, sizes, departures = draw.vector(14), 400, [0.0025, 0.005, 0.01], []
    for size in sizes:
        error = size * direction
        expected, _ = _linear(inertia, _PID, error, count)
        found = _closed_loop(
            robot, PidLaw(robot, _PID), _at_rest(_BENT - error), q, np.zeros(20), count, held=True
        )
        departures.append(float(np.max(np.abs(found[1:] - expected))))
    claim = "PID on the free robot: order in the error of the departure from the linear simulation, less 2"
    against = "linear simulation of the frozen robot"
    record(claim, abs(slope(sizes, departures) - 2.0), 0.1, against=against)
    # The frozen model leaves out terms of the second order in angles and rates, each weighted below 10.
    claim = "PID on the free robot, errors up to 0.0025 rad: departure from the linear simulation"
    record(claim, departures[0] / sizes[0], 10.0 * sizes[0], against=against)


def test_anti_windup(robot: RobotModel, record: Record) -> None:
    """A second at the limit leaves no trace in the integral."""
    bench = Bench(robot, _PID)
    for _ in range(500):
        bench.step(0.1)
    before = bench.integral_effort
    for _ in range(1000):
        assert abs(bench.step(100.0)) == bench.limit
    claim = "PID: change of the integral effort over 1 s at the limit"
    record(claim, abs(bench.integral_effort - before), 0.0, unit="N m", against="conditional integration")
    expected = before + 2.0 * 0.1
    claim = "PID: effort off u = -(K_P e + K_I z) in the tick after a second at the limit"
    off = abs(bench.step(-0.1) - expected)
    record(claim, off, 4 * _EPS * abs(expected), unit="N m", against="the same run without that second")


def test_responses_as_a_table(table: Table) -> None:
    """Settling and overshoot that each order promises for T_r = 1 s, from the closed form."""
    rows = ["| order r | A1 [1/s^2] | A2 [1/s] | damping ratio | overshoot | settled to 2 % [s] |"]
    rows.append("|---|---|---|---|---|---|")
    time = np.linspace(0.0, 10.0, 10001)
    for order in _ORDERS:
        gains = NmpcGains(1.0, order)
        response = _oscillator(gains, time, np.ones(1), np.zeros(1))[:, 0]
        ratio = gains.velocity_gain / (2.0 * np.sqrt(gains.position_gain))
        settled = time[np.flatnonzero(np.abs(response) > 0.02)[-1]]
        rows.append(
            f"| {order} | {gains.position_gain:.4g} | {gains.velocity_gain:.4g} | {ratio:.4f} | "
            f"{-100.0 * response.min():.2f} % | {settled:.2f} |"
        )
    table("What each control order promises for T_r = 1 s (times scale with T_r):\n\n" + "\n".join(rows))
