"""Limits of joints: what is reported, and motors and stops that keep them against closed forms."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product as combinations
from math import ceil, exp, inf, sqrt

import numpy as np
import pytest

from sms_handover.analysis.joint_limits import limit_use
from sms_handover.graph.events import POSITION_EXCEEDED, RATE_EXCEEDED, RunEvent
from sms_handover.graph.topics import PLANT
from sms_handover.model.assembly import ArmDescription, Base, RobotDescription
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.parts import Gripper, Inertia, JointDescription, LinkDescription, Origin
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.complementarity import solve_bounded
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.joint_limits import ENFORCE, REPORT, JointLimitWatch
from sms_handover.plant.joint_stops import JointStops
from sms_handover.plant.plant_state import InitialState
from sms_handover.simulation.scenario import load_parameters
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, Pose

from .conftest import Draw, MakeScenario
from .robots import someone_else

_EPS = float(np.finfo(float).eps)
_MS = 1_000_000  # [ns]
_TICK = 1e-3  # [s]
_ZERO = (0.0, 0.0, 0.0)
_HOME = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
_MOUNT = (0.5, 0.3)  # [m] of the only joint of a wheel, in the plane through the centre of its base
_RATED = 0.8  # [-] of the rate limit


def _plant(robot: RobotModel, joints: Array, limits: str = ENFORCE) -> FreeFloatingPlant:
    parameters = replace(load_parameters().plant, joint_limits=limits, rated_speed=_RATED)
    return FreeFloatingPlant(robot, parameters, InitialState(_HOME, joints, _HOME, {}), _MS)


class Wheel:
    """A robot with one joint, about z through the centre of mass of all that it moves.

    Its reduced inertia is constant: with the moment I of what it moves, and C of the base with that mass at
    the mount, both about z, it is I C / (I + C), and the base turns at -I / (I + C) of the joint's rate.
    """

    def __init__(self, *, upper: float = 2.0, velocity: float = 100.0, effort: float = 50.0) -> None:
        """Make it with these limits in rad, rad/s and N m; the lower limit is -2 rad."""
        origin = Origin((*_MOUNT, 0.0), _ZERO)
        joint = JointDescription("arm_joint_1", origin, (0.0, 0.0, 1.0), -2.0, upper, velocity, effort)
        inertia = Inertia("arm_link_1", 3.0, _ZERO, (0.2, 0.0, 0.0, 0.2, 0.0, 0.3))
        link = LinkDescription("arm_link_1", inertia, 0.05)
        flange = Origin((0.0, 0.0, -0.1), _ZERO)  # so that the centre of the gripper is in the plane too
        gripper = Gripper("arm_gripper", 1.0, 0.1, 0.2)
        arm = ArmDescription("arm", Origin(_ZERO, _ZERO), (joint,), (link,), flange, gripper)
        body = Inertia("base_link", 20.0, _ZERO, (2.0, 0.0, 0.0, 2.0, 0.0, 3.0))
        self.robot = RobotModel(RobotDescription("wheel", Base(body, (1.0, 1.0, 1.0)), (arm,)))
        moved = 0.3 + 0.5 * 1.0 * 0.1**2  # [kg m^2] link and gripper
        rest = 3.0 + 20.0 * 4.0 / 24.0 * (_MOUNT[0] ** 2 + _MOUNT[1] ** 2)  # [kg m^2]
        self.inertia = moved * rest / (moved + rest)
        self.reaction = -moved / (moved + rest)

    def plant(self, at: float = 0.0) -> FreeFloatingPlant:
        """Return a plant that enforces the limits, with the joint at an angle."""
        return _plant(self.robot, np.array([at]))


# Stops


def test_a_joint_meets_its_stop_when_and_as_fast_as_a_constant_torque_says() -> None:
    """At t = sqrt(2 d I* / u) I* q'^2 / 2 is lost; joint and base, which turned against it, both rest."""
    way, torque = 0.1, 2.0  # [rad], [N m]
    wheel = Wheel(upper=way)
    plant, effort = wheel.plant(), np.array([torque])
    ticks = ceil(sqrt(2.0 * way * wheel.inertia / torque) / _TICK)
    for _ in range(ticks - 1):
        plant.apply(effort)
    assert plant.losses == 0.0
    assert plant.v[-1] == pytest.approx(torque * (ticks - 1) * _TICK / wheel.inertia, rel=1e-12)
    assert plant.v[BASE_NV - 1] == pytest.approx(wheel.reaction * plant.v[-1], rel=1e-12)
    plant.apply(effort)
    rate = torque * ticks * _TICK / wheel.inertia
    assert 0.0 <= plant.q[-1] - way <= rate * _TICK
    np.testing.assert_allclose(plant.v, 0.0, atol=100 * _EPS)
    assert plant.losses == pytest.approx(0.5 * wheel.inertia * rate**2, rel=1e-12)
    assert plant.work - plant.losses == pytest.approx(0.0, abs=1e-12 * plant.work)


def test_a_stop_holds_a_joint_while_it_presses_and_no_longer() -> None:
    """It rests where it has met the stop, whatever presses, and leaves like a free joint when that turns."""
    wheel = Wheel(upper=0.05)
    plant = wheel.plant(at=0.05)
    for torque in (5.0, 40.0, 0.0, 3.0, 40.0, 1.0):
        for _ in range(20):
            plant.apply(np.array([torque]))
        np.testing.assert_allclose(plant.v, 0.0, atol=100 * _EPS)
        assert plant.q[-1] == pytest.approx(0.05, abs=100 * _EPS)
    lost = plant.losses
    for tick in range(1, 31):
        plant.apply(np.array([-5.0]))
        assert plant.v[-1] == pytest.approx(-5.0 * tick * _TICK / wheel.inertia, rel=1e-9)
    assert plant.losses == lost
    assert plant.work - plant.losses == pytest.approx(plant.conserved.kinetic_energy, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_stops_take_energy_and_no_momentum(seed: int) -> None:
    """Several at once, on a robot with no number of the shipped one: to rounding, and by their energy."""
    robot = RobotModel(someone_else(load_robot(), seed))
    draw = Draw(robot, seed)
    for _ in range(10):
        q, v, side = draw.q(), draw.v(), np.sign(draw.vector(robot.n_joints))
        after, lost = JointStops(robot, _TICK).impact(q, v, side)
        before, then = (conserved_quantities(robot, q, rates) for rates in (v, after))
        size = float(np.abs(after - v).max() * robot.mass)
        np.testing.assert_allclose(
            then.linear_momentum, before.linear_momentum, rtol=0.0, atol=100 * _EPS * size
        )
        np.testing.assert_allclose(
            then.angular_momentum, before.angular_momentum, rtol=0.0, atol=100 * _EPS * size
        )
        assert lost == pytest.approx(before.kinetic_energy - then.kinetic_energy, rel=1e-9)
        assert lost > 0.0
        outward = side * after[BASE_NV:]
        assert np.all(outward <= 1e-12)
        assert 0 < np.count_nonzero(outward < -1e-3) < robot.n_joints  # some leave, the others rest


def test_a_complementarity_problem_has_the_solution_that_all_cases_tried_give() -> None:
    """Each entry at a bound or between, 81 cases for four: one of them has no wrong sign."""
    random = np.random.default_rng(3)
    for _ in range(50):
        root, offset = random.normal(size=(4, 4)), 3.0 * random.normal(size=4)
        matrix, upper = root @ root.T + 0.1 * np.eye(4), random.uniform(0.1, 2.0, size=4)
        upper[0] = inf
        assert solve_bounded(matrix, offset, upper) == pytest.approx(_tried(matrix, offset, upper), abs=1e-12)


def _tried(matrix: Array, offset: Array, upper: Array) -> Array:
    for case in combinations(range(3), repeat=4):
        side = np.array(case)
        if side[0] == 2:  # its upper bound is infinite
            continue
        x, between = np.where(side == 2, upper, 0.0), side == 1
        right = -(offset + matrix @ x)[between]
        x[between] = np.linalg.solve(matrix[np.ix_(between, between)], right)
        w = offset + matrix @ x
        inside = (x[between] > 0.0).all() and (x[between] < upper[between]).all()
        if inside and (w[side == 0] > 0.0).all() and (w[side == 2] < 0.0).all():
            return x
    raise AssertionError("no case fits")


# Motors


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motor_runs_up_to_its_limit_as_its_torque_speed_line_says(sign: float) -> None:
    """To r w under full torque, then w - (1 - r) w exp(-t / T) with T = I* (1 - r) w / u; full brakes."""
    limit, torque = 1.0, 2.0  # [rad/s], [N m]
    wheel = Wheel(velocity=limit, effort=torque)
    constant = wheel.inertia * (1.0 - _RATED) * limit / torque  # [s]
    until_rated = _RATED * limit * wheel.inertia / torque  # [s]
    plant, effort = wheel.plant(), np.array([sign * torque])
    for tick in range(1, 501):
        plant.apply(effort)
        time = tick * _TICK - until_rated
        if time < 0.0:
            expected, bound = torque * tick * _TICK / wheel.inertia, 1e-12
        else:  # a tick takes the line at its end, so it is late by up to a tick
            expected = limit - (1.0 - _RATED) * limit * exp(-time / constant)
            bound = _TICK / constant * (1.0 - _RATED) * limit
        rate = sign * plant.v[-1]
        assert rate == pytest.approx(expected, abs=bound) and rate <= limit + 1e-12
        line = torque * min(1.0, (limit - rate) / ((1.0 - _RATED) * limit))
        assert sign * plant.joint_effort[0] == pytest.approx(line, abs=1e-9)
    plant.apply(-effort)
    assert plant.joint_effort[0] == -effort[0]


def test_a_motor_does_not_brake_a_joint_that_is_dragged_past_its_limit() -> None:
    """It gives nothing in the direction of the motion, and all that it is asked for in the other."""
    wheel = Wheel(velocity=1.0)
    plant = wheel.plant()
    rates = np.array([0.0, 0.0, 0.0, 0.0, 0.0, wheel.reaction, 1.0])
    for asked, given in ((5.0, 0.0), (0.0, 0.0), (-5.0, -5.0)):
        plant.restore(replace(plant.snapshot(), v=2.0 * rates))
        plant.apply(np.array([asked]))
        assert plant.joint_effort[0] == given
        assert plant.v[-1] == pytest.approx(2.0 + given * _TICK / wheel.inertia, rel=1e-9)


def test_a_motor_that_could_pass_the_limit_within_a_tick_does_not() -> None:
    """However strong it is, as the line holds for the rate that its torque leads to."""
    plant = Wheel(velocity=1.0, effort=5000.0).plant()
    for _ in range(50):
        plant.apply(np.array([5000.0]))
        assert 0.98 < plant.v[-1] <= 1.0 + 1e-12


# Both, on a robot with many joints


def _caged() -> RobotModel:
    """Return a robot whose joints have 0.1 rad of room, and a quarter of the rates that they had."""

    def joint(old: JointDescription) -> JointDescription:
        return replace(old, lower=0.45, upper=0.55, velocity=0.25 * old.velocity)

    description = someone_else(load_robot(), seed=6)
    arms = tuple(replace(arm, joints=tuple(map(joint, arm.joints))) for arm in description.arms)
    return RobotModel(replace(description, arms=arms))


def test_a_robot_in_a_cage_keeps_limits_and_momentum_and_books_what_it_loses() -> None:
    """Under efforts that change at random every 60 ms, with several joints at their stops at once."""
    robot = _caged()
    draw, plant, watch = Draw(robot, seed=7), _plant(robot, np.full(14, 0.5)), JointLimitWatch(robot, _MS)
    limit, fastest, most_at_once, largest = robot.pin.velocityLimit[BASE_NV:], 0.0, 0, 0.0
    effort = np.zeros(14)
    for tick in range(600):
        if tick % 60 == 0:
            effort = draw.effort(plant.q, 10.0)
        lost = plant.losses
        plant.apply(effort)
        watch.add(plant.tick, plant.q, plant.v)
        joints, rates, now = plant.q[BASE_NQ:], plant.v[BASE_NV:], plant.conserved
        fastest, largest = max(fastest, float(np.abs(rates).max())), max(largest, now.kinetic_energy)
        beyond = np.maximum(joints - robot.upper, robot.lower - joints)
        assert beyond.max() <= fastest * _TICK
        at = beyond >= 0.0
        most_at_once = max(most_at_once, int(at.sum()))
        assert np.all((np.sign(joints - 0.5) * rates)[at] <= 1e-12)
        driven = plant.joint_effort * rates > 0.0
        if plant.losses == lost:  # else an impact has changed rates after the motors have acted
            assert np.all(np.abs(rates)[driven] <= 1.001 * limit[driven])
        assert np.linalg.norm(now.linear_momentum) < 1e-9  # [kg m/s], by the integrator, as without limits
        assert np.linalg.norm(now.angular_momentum) < 1e-9  # [kg m^2/s]
        assert now.kinetic_energy == pytest.approx(plant.work - plant.losses, abs=1e-9)  # [J]
    assert most_at_once >= 5 and plant.losses > 0.5 * largest > 0.1  # [J]
    kinds = {event.kind for event in watch.end(plant.stamp_ns)}
    assert POSITION_EXCEEDED in kinds


def test_limits_that_are_not_reached_change_no_bit(robot: RobotModel, draw: Draw) -> None:
    joints = draw.joints(margin=0.5)
    free, kept = (_plant(robot, joints, limits) for limits in (REPORT, ENFORCE))
    assert load_parameters().plant.joint_limits == REPORT
    for _ in range(50):
        effort = draw.effort(free.q, 10.0)
        for plant in (free, kept):
            plant.apply(effort)
    assert np.abs(free.v[BASE_NV:]).max() > 0.05  # [rad/s]
    for name in ("q", "v", "joint_effort"):
        assert getattr(free, name).tobytes() == getattr(kept, name).tobytes()
    assert (free.work, free.losses) == (kept.work, kept.losses) and free.losses == 0.0


# Events


def _told(watch: JointLimitWatch, rates: Sequence[float], positions: Sequence[float] = ()) -> list[RunEvent]:
    """Return the events of a wheel with these rates and positions, tick by tick, until the end."""
    events: list[RunEvent] = []
    for tick, rate in enumerate(rates):
        q, v = np.zeros(BASE_NQ + 1), np.zeros(BASE_NV + 1)
        q[-1], v[-1] = positions[tick] if positions else 0.0, rate
        events += watch.add(tick, q, v)
    return [*events, *watch.end((len(rates) - 1) * _MS)]


def test_each_excess_is_told_once_with_its_figures() -> None:
    rates, positions = [0.0] * 1001, [0.0] * 1001
    rates[5:8], rates[50], rates[300] = (
        [1.5, -2.0, 1.2],
        1.1,
        1.01,
    )  # one excess, as less than 0.1 s is between
    positions[600:700], positions[990:] = [0.2] * 100, [-2.5] * 11
    first, second, third, last = _told(
        JointLimitWatch(Wheel(upper=0.1, velocity=1.0).robot, _MS), rates, positions
    )
    detail = "arm_joint_1 turned faster than the limit of its rate for 0.004 s, from 0.005 to 0.051 s"
    assert (first.stamp_ns, first.kind, first.detail) == (200 * _MS, RATE_EXCEEDED, detail)
    assert (first.value, first.limit, first.unit) == (2.0, 1.0, "rad/s")
    assert (second.stamp_ns, second.value) == (500 * _MS, 1.01)
    detail = "arm_joint_1 was beyond a limit of its position for 0.1 s, from 0.6 to 0.7 s"
    assert (third.stamp_ns, third.kind, third.detail) == (800 * _MS, POSITION_EXCEEDED, detail)
    assert (third.value, third.limit, third.unit) == (0.2, 0.1, "rad")
    assert (last.stamp_ns, last.value, last.limit) == (1000 * _MS, -2.5, -2.0)


def test_a_joint_that_chatters_about_a_limit_is_told_of_once() -> None:
    (event,) = _told(JointLimitWatch(Wheel(velocity=1.0).robot, _MS), [0.9, 1.1] * 1000)
    assert "for 1 s, from 0.001 to 2 s" in event.detail


def test_events_of_a_run_say_what_its_states_say(make_scenario: MakeScenario) -> None:
    limits = {"joint_6": {"velocity": 0.1, "position": [-1.41, 0.0]}}  # [rad/s], [rad]
    scenario = make_scenario(controller={"law": "pid"}, robot={"arms.arm_a.limits": limits})
    run = simulate(scenario)
    use = limit_use(run, scenario.truth.robot.pin)
    rate, position = sorted(
        (e for e in run.run_events if e.node == PLANT), key=lambda event: event.unit == "rad"
    )
    assert (rate.kind, rate.value / rate.limit) == (RATE_EXCEEDED, use.rate.value)
    assert f"arm_a_joint_6 turned faster than the limit of its rate for {use.rate.beyond:g} s" in rate.detail
    assert (position.kind, position.limit) == (POSITION_EXCEEDED, -1.41)
    assert position.limit - position.value == use.position.value > 0.0
