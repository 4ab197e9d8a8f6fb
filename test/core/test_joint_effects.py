"""Joint effects: friction against closed forms, errors of torque and command against what they declare."""

from collections.abc import Callable
from itertools import pairwise
from math import exp, log
from pathlib import Path

import numpy as np
import pytest

from sms_handover.compiled.effects import CompiledResistedStepper
from sms_handover.conditions.joint_values import FrictionValues, TorqueErrors
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.errors import ConfigurationError
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.command_path import CommandPath
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance, ResistedStepper
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.motor_torque import MotorTorque
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.simulation.scenario import load_scenario
from sms_handover.types import BASE_NQ, Array, Pose
from sms_handover.units import seconds_to_ns
from test.evidence import Record

from .conftest import Draw
from .robots import someone_else
from .test_joint_limits import Wheel

HOME = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
_EPS = float(np.finfo(float).eps)


def _ones(value: float, count: int = 2) -> Array:
    return np.full(count, value)


@pytest.mark.parametrize("tick", [1e-3, 0.25e-3])
def test_torque_noise_has_its_declared_density_whatever_the_tick(tick: float, record: Record) -> None:
    """The variance of the momentum after T is D^2 T; of 2000 samples it is known to 3 % (one sigma)."""
    density, joints, ticks = 0.003, 40, 50  # [N m/sqrt(Hz)], [-], [-]
    zeros = np.zeros(joints)
    motor = MotorTorque(TorqueErrors(zeros, zeros, zeros, _ones(density, joints)), tick, RandomStreams(5))
    torques = np.array([motor.given(k, zeros) for k in range(50 * ticks)])
    momenta = tick * torques.reshape(50, ticks, joints).sum(axis=1)
    apart = abs(momenta.var() / (density**2 * ticks * tick) - 1.0)
    told, by = f"torque noise at a tick of {tick * 1e3:g} ms:", "the declared density"
    record(f"{told} variance of its impulse, relative error", apart, 0.12, against=by)
    spectrum = np.abs(np.fft.fft(torques, axis=0)) ** 2 * tick / len(torques)  # two-sided
    thirds = np.array_split(spectrum.mean(axis=1)[1 : len(torques) // 2], 3)
    flat = max(abs(float(part.mean()) / density**2 - 1.0) for part in thirds)
    record(f"{told} spectral density in thirds of the band, relative error", flat, 0.05, against=by)


def test_gain_offset_and_step_are_those_declared() -> None:
    zeros = np.zeros(2)
    errors = TorqueErrors(np.array([0.05, 0.0]), np.array([0.0, -0.2]), np.array([0.0, 0.1]), zeros)
    motor = MotorTorque(errors, 1e-3, RandomStreams(0))
    given = motor.given(0, np.array([2.0, 0.26]))
    assert given == pytest.approx([2.1, 0.1], abs=4 * _EPS)


def test_a_command_arrives_after_its_delay_and_a_lost_one_leaves_that_before() -> None:
    streams = RandomStreams(3)
    path = CommandPath(1, 3, 0.0, streams)
    arrived = [float(path.arriving(k, np.array([k + 1.0]))[0]) for k in range(6)]
    assert arrived == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]

    path = CommandPath(1, 0, 0.3, streams)
    arrived = [float(path.arriving(k, np.array([k + 1.0]))[0]) for k in range(2000)]
    held = [now for now, sent in enumerate(arrived) if sent != now + 1.0]
    assert len(held) / 2000 == pytest.approx(0.3, abs=0.04)  # four sigma
    assert all(arrived[k] == (arrived[k - 1] if k else 0.0) for k in held)

    before = path.state
    after = [float(path.arriving(k, np.array([1.0 * k]))[0]) for k in range(2000, 2050)]
    path.reset()
    path.state = before
    assert after == [float(path.arriving(k, np.array([1.0 * k]))[0]) for k in range(2000, 2050)]


# Friction of one joint, whose reduced inertia is constant


def _friction(viscous: float, coulomb: float, stiction: float | None = None) -> FrictionValues:
    bound = coulomb if stiction is None else stiction
    return FrictionValues(_ones(viscous, 1), _ones(coulomb, 1), _ones(bound, 1), _ones(0.01, 1))


Make = Callable[[RobotModel, FrictionValues, str, float], ResistedStepper]


def _by_python(robot: RobotModel, values: FrictionValues, scheme: str, tick: float) -> ResistedStepper:
    resistance, tableau = Resistance(JointFriction(values, tick), ()), TABLEAUS[scheme]
    return ConditionedStepper(robot, resistance, PinocchioStepper(robot, tableau, tick), tableau, tick)


def _in_c(robot: RobotModel, values: FrictionValues, scheme: str, tick: float) -> ResistedStepper:
    resistance = Resistance(JointFriction(values, tick), ())
    return CompiledResistedStepper(robot, resistance, TABLEAUS[scheme], seconds_to_ns(tick))


_BY: dict[Make, str] = {_by_python: "ticks of Python", _in_c: "ticks of C"}


@pytest.fixture(params=_BY, ids=["python", "c"])
def make(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, compiled_cache: Path) -> Make:
    """Return what makes the steps, with the folder of all modules for libraries."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(compiled_cache))
    given: Make = request.param
    return given


class Wheel1:
    """The wheel under friction, moved on tick by tick from an angle of 0 and a rate."""

    def __init__(self, make: Make, values: FrictionValues, tick: float, rate: float = 0.0) -> None:
        wheel = Wheel(upper=100.0)
        self.robot, self.inertia, self.tick = wheel.robot, wheel.inertia, tick
        self._stepper = make(self.robot, values, "rk4", tick)
        self.q = self.robot.configuration(HOME, np.zeros(1))
        self.v = np.array([*_ones(0.0, 5), wheel.reaction * rate, rate])
        self.lost = 0.0

    def run(self, effort: float, seconds: float) -> tuple[float, float]:
        """Return angle and rate after some time under a constant torque."""
        for _ in range(round(seconds / self.tick)):
            self.q, self.v = self._stepper.step(self.q, self.v, np.array([effort]))
            self.lost += self._stepper.lost
        return float(self.q[-1]), float(self.v[-1])


def _errors(run: Callable[[float], float], exact: float) -> list[float]:
    """Return the error of a run at a tick of 4 ms, a quarter of it and a sixteenth."""
    return [abs(run(tick) - exact) for tick in (4e-3, 1e-3, 0.25e-3)]


def test_a_slipping_joint_speeds_up_as_its_closed_form_with_an_order_of_at_least_one(
    make: Make, record: Record
) -> None:
    """I* w' = u - tau_c - f_v w: w = (u - tau_c) / f_v (1 - exp(-f_v t / I*))."""
    viscous, coulomb, effort, seconds = 0.8, 0.5, 1.5, 0.4  # [N m s/rad], [N m], [N m], [s]

    def rate(tick: float) -> float:
        return Wheel1(make, _friction(viscous, coulomb), tick).run(effort, seconds)[1]

    inertia = Wheel().inertia
    exact = (effort - coulomb) / viscous * (1.0 - exp(-viscous * seconds / inertia))
    errors, against = _errors(rate, exact), "closed form of one joint"
    claim = f"a joint that slips, {_BY[make]}: rate after 0.4 s"
    record(f"{claim}, relative error at a tick of 4 ms", errors[0] / exact, 0.01, against=against)
    left = max(fine / coarse for coarse, fine in pairwise(errors))
    record(f"{claim}, share of the error left at a quarter of the tick", left, 0.26, against=against)


def test_a_joint_comes_to_rest_when_and_where_its_closed_form_says_and_stays(
    make: Make, record: Record
) -> None:
    """I* w' = -tau_c - f_v w stops at t = I* / f_v ln(1 + f_v w_0 / tau_c); half a second later it rests."""
    viscous, coulomb, start = 0.2, 0.5, 1.2  # [N m s/rad], [N m], [rad/s]
    inertia = Wheel().inertia
    stops = inertia / viscous * log(1.0 + viscous * start / coulomb)
    way = inertia * start / viscous - coulomb / viscous * stops

    def angle(tick: float) -> float:
        wheel = Wheel1(make, _friction(viscous, coulomb), tick, start)
        found, rate = wheel.run(0.0, stops + 0.5)
        assert abs(rate) < 1e-14
        assert wheel.lost == pytest.approx(0.5 * inertia * start**2, rel=1e-9)
        return found

    errors, against = _errors(angle, way), "closed form of one joint"
    assert all(fine < 0.4 * coarse for coarse, fine in pairwise(errors))
    claim = f"a joint that friction stops, {_BY[make]}: where it rests"
    record(f"{claim}, relative error at a tick of 4 ms", errors[0] / way, 0.01, against=against)
    left = errors[2] / errors[0]
    record(f"{claim}, share of the error left at a sixteenth of the tick", left, 1.0 / 16.0, against=against)


def test_a_joint_at_rest_bears_its_stiction_and_then_falls_to_coulomb_friction(
    make: Make, record: Record
) -> None:
    values = _friction(0.0, 0.3, 0.5)
    moved = float(np.abs(Wheel1(make, values, 1e-3).run(0.49, 0.1)).max())
    claim = f"a joint that sticks under 0.98 of its stiction, {_BY[make]}: angle and rate after 0.1 s"
    record(claim, moved, 1e-14, unit="rad, rad/s", against="rest")
    wheel = Wheel1(make, values, 0.25e-3)
    wheel.run(0.51, 0.5)
    before = wheel.v[-1]
    wheel.run(0.51, 0.1)
    apart = abs((wheel.v[-1] - before) * wheel.inertia / (0.1 * (0.51 - 0.3)) - 1.0)
    claim = f"a joint that broke away, {_BY[make]}: angular impulse in 0.1 s, relative error"
    record(claim, apart, 1e-9, against="Coulomb friction")


def test_friction_keeps_the_balance_of_energy_and_momentum(draw: Draw, record: Record) -> None:
    """E - W + losses to 1e-9 of the total work at 1 ms, and no momentum, with all joints of another robot."""
    robot = RobotModel(someone_else(load_robot(), 4))
    count, tick = robot.n_joints, 1e-3
    values = FrictionValues(*(_ones(x, count) for x in (0.3, 0.2, 0.3, 0.01)))
    resistance = Resistance(JointFriction(values, tick), ())
    inner = PinocchioStepper(robot, TABLEAUS["rk4"], tick)
    stepper = ConditionedStepper(robot, resistance, inner, TABLEAUS["rk4"], tick)
    q = robot.configuration(HOME, draw.joints())
    v, work, gross, lost = np.zeros(robot.pin.nv), 0.0, 0.0, 0.0
    for k in range(400):
        effort = 0.6 * np.sin(0.02 * k + np.arange(count))
        start = q
        q, v = stepper.step(q, v, effort)
        parts = effort * (q - start)[BASE_NQ:]
        work, gross, lost = work + parts.sum(), gross + np.abs(parts).sum(), lost + stepper.lost
    after = conserved_quantities(robot, q, v)
    assert lost > 0.1 * gross
    apart = abs(after.kinetic_energy - work + lost) / gross
    record("E - W + losses under friction, rk4 at 1 ms, share of the total work", apart, 1e-9, against="0")
    momenta = np.abs([after.linear_momentum, after.angular_momentum]).max()
    record("momenta under friction, from rest", momenta, 1e-11, unit="N s, N m s", against="0")


@pytest.mark.parametrize(("scheme", "order"), [("rk4", 4), ("midpoint", 2)])
def test_the_balance_of_energy_closes_with_the_order_of_the_scheme(
    make: Make, scheme: str, order: int, record: Record
) -> None:
    """At ticks of 8 and 2 ms, with rotors, from rest over slipping to sticking joints."""
    robot = load_scenario("smooth", {"conditions.rotor_inertia": 0.31}).truth.robot
    count, apart = robot.n_joints, []
    values = FrictionValues(*(_ones(x, count) for x in (0.3, 0.2, 0.3, 0.01)))
    for tick in (8e-3, 2e-3):
        stepper, q = (
            make(robot, values, scheme, tick),
            robot.configuration(HOME, np.linspace(-1.0, 1.0, count)),
        )
        v, work, gross, lost = np.zeros(robot.pin.nv), 0.0, 0.0, 0.0
        for k in range(round(0.4 / tick)):
            effort, before = 3.0 * np.sin(10.0 * k * tick + np.arange(count)), q
            q, v = stepper.step(q, v, effort)
            parts = effort * (q - before)[BASE_NQ:]
            work, gross, lost = work + parts.sum(), gross + np.abs(parts).sum(), lost + stepper.lost
        assert lost > 0.02 * gross
        apart.append(abs(conserved_quantities(robot, q, v).kinetic_energy - work + lost) / gross)
    assert apart[0] < 1e-4
    claim = f"E - W + losses under friction, {scheme}, {_BY[make]}: share of it left at a quarter of the tick"
    record(claim, apart[1] / apart[0], 4.0 ** (0.5 - order), against=f"order {order}, less a half")


def test_stiction_is_at_least_the_coulomb_friction() -> None:
    with pytest.raises(ConfigurationError, match="must be >= the Coulomb friction of 0"):
        FrictionValues(_ones(0.0), _ones(0.2), _ones(0.1), _ones(0.01))
