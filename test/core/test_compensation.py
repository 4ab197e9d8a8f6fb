"""Compensation: what acts besides a law's efforts is observed, integrated away or known; taken off once."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm

from sms_handover.control.compensation import CompensatedTorque, Compensation
from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.control.disturbance_observer import DisturbanceObserver
from sms_handover.control.friction_feed_forward import FrictionFeedForward
from sms_handover.control.integral_action import IntegralAction
from sms_handover.control.law import LinearFeedback
from sms_handover.control.nmpc import NmpcGains, NmpcLaw
from sms_handover.control.stability import sampled_loop
from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import Array

from .conftest import Draw

BANDWIDTH, TICK, INTEGRAL = 20.0, 1e-3, IntegralAction(0.1, 1e-3)  # [1/s], [s], T_i 0.1 s
OBSERVED = Compensation(TICK, bandwidth=BANDWIDTH)
GAINS = 40.0, 12.0  # [1/s^2], [1/s]
FEEDBACK = np.repeat([[GAINS[0]], [GAINS[1]]], 14, axis=1)
FRICTION = FrictionFeedForward(0.1, 0.02, 0.05)  # N m s/rad, N m, rad/s
HALF = FrictionFeedForward(0.05, 0.01, 0.05)
Disturb = Callable[[Array], Array]


def followed(
    robot: RobotModel, scenario: Scenario, torque: CompensatedTorque, disturb: Disturb, ticks: int
) -> float:
    """Return the largest joint error in a swing of 0.2 rad from rest, under torques that depend on rates."""
    parameters = scenario.parameters
    plant = make_plant(robot, scenario.truth.schedule, parameters.common, parameters.plant)
    start = np.array(plant.q[BASE_NQ:])
    for tick in range(ticks):
        phase = tick * TICK
        desired = np.array([start + 0.2 * (1.0 - np.cos(phase)), np.full(14, 0.2 * np.sin(phase)), start])
        desired[2] = 0.2 * np.cos(phase)
        plant.apply(torque(plant.q, plant.v, desired, FEEDBACK) + disturb(plant.v[BASE_NV:]))
    return float(np.abs(plant.q[BASE_NQ:] - start - 0.2 * (1.0 - np.cos(ticks * TICK))).max())


def compensated(robot: RobotModel, compensation: Compensation) -> CompensatedTorque:
    """Return the computed torque of a robot with a compensation."""
    return CompensatedTorque(robot, ComputedTorque(robot), compensation)


def estimate_of(torque: CompensatedTorque) -> Array:
    """Return what is observed."""
    assert torque.observer is not None
    return torque.observer.estimate


def test_a_constant_torque_is_found_and_taken_off(robot: RobotModel, scenario: Scenario) -> None:
    """By the observer, behind a lag of 1/K, and by integral action, while the arms move."""
    disturbance = np.zeros(14)
    disturbance[[1, 8]] = 0.3, -0.2  # N m

    def disturb(_: Array) -> Array:
        return disturbance

    found = compensated(robot, OBSERVED)
    followed(robot, scenario, found, disturb, 51)
    share = estimate_of(found)[[7, 14]] / disturbance[[1, 8]]
    np.testing.assert_allclose(share, 1.0 - np.exp(-BANDWIDTH * 50 * TICK), atol=0.02)

    plain = followed(robot, scenario, compensated(robot, Compensation(TICK)), disturb, 1000)
    observed, integrated = (
        compensated(robot, item) for item in (OBSERVED, Compensation(TICK, integral=INTEGRAL))
    )
    assert followed(robot, scenario, observed, disturb, 1000) < 0.05 * plain
    assert followed(robot, scenario, integrated, disturb, 1000) < 0.05 * plain
    np.testing.assert_allclose(estimate_of(observed)[6:], disturbance, atol=2e-3)
    np.testing.assert_allclose(estimate_of(observed)[:6], 0.0, atol=2e-3)


def test_what_acts_on_base_and_joints_is_taken_off_the_joints(robot: RobotModel, draw: Draw) -> None:
    """By forward dynamics: the joints accelerate as if nothing acted, however the base is pushed."""
    observer = DisturbanceObserver(robot, BANDWIDTH, TICK)
    q, v, efforts, acting = draw.q(), draw.v(0.3), draw.vector(20, 3.0), draw.vector(20, 3.0)
    observer.begin_with(acting)
    taken_off = np.concatenate([np.zeros(BASE_NV), observer.joint_effect(q, v)])
    free, pushed = (
        pin.aba(robot.pin, robot.data, q, v, force)[BASE_NV:].copy()
        for force in (efforts, efforts + acting - taken_off)
    )
    np.testing.assert_allclose(pushed, free, rtol=1e-9, atol=1e-9)


def test_integral_action_has_the_response_of_its_equation() -> None:
    """To a step of the disturbance, with the first order of the tick; the sampled loop has its roots."""
    (position, rate), time, ticks = GAINS, INTEGRAL.time, 500
    matrix = np.array([[0, 1, 0, 0], [-position, -rate, -1, 1], [position / time, rate / time, 0, 0]])
    system = np.vstack([matrix, np.zeros(4)])  # of e, e', y and a disturbance of 1 rad/s^2
    expected = expm(system * ticks * TICK)[:3, 3]
    error, speed, action, free = 0.0, 0.0, np.zeros(1), np.zeros(1)
    for _ in range(ticks):
        pull = position * error + rate * speed
        acceleration = 1.0 - pull - float(action[0])
        action = INTEGRAL.advanced(action, np.array([pull]), free, free)
        error += TICK * speed + 0.5 * TICK**2 * acceleration
        speed += TICK * acceleration
    np.testing.assert_allclose([error, speed, action[0]], expected, rtol=0.02, atol=1e-4)

    def bare(_: object, inertia: Array) -> LinearFeedback:
        return LinearFeedback(position * inertia, rate * inertia, np.zeros_like(inertia))

    inertia = np.array([[3.0]])  # kg m^2
    loop = sampled_loop(inertia, INTEGRAL.linearised(bare)(None, inertia), TICK)
    roots = np.roots([1.0, rate, position + rate / time, position / time])
    found = np.log(np.linalg.eigvals(loop).astype(complex)) / TICK
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(roots), rtol=0.05)


def test_a_joint_at_its_limit_integrates_only_what_leads_it_away() -> None:
    pull = np.array([1.0, -1.0, 1.0])
    wanted, given = np.array([-50.0, -50.0, -5.0]), np.array([-39.0, -39.0, -5.0])  # N m
    found = INTEGRAL.advanced(np.zeros(3), pull, wanted, given)
    np.testing.assert_allclose(found, [0.0, -0.01, 0.01], atol=1e-15)


def test_the_believed_friction_is_viscous_and_smoothed_dry_friction() -> None:
    """Odd, f_v w + tau_c beyond the speed v_s, and of the slope f_v + tau_c / v_s at rest."""
    rates = np.array([-1.0, -0.05, 0.0, 0.05, 1.0])
    torques = FRICTION.torque(rates)
    np.testing.assert_allclose(torques, -FRICTION.torque(-rates), atol=1e-15)
    np.testing.assert_allclose(torques[-1], 0.1 + 0.02, atol=1e-12)
    np.testing.assert_allclose(FRICTION.torque(np.array([1e-6])), 1e-6 * (0.1 + 0.02 / 0.05), rtol=1e-6)


def test_known_friction_leaves_no_error_and_nothing_to_observe(robot: RobotModel, scenario: Scenario) -> None:
    """What is believed is not compensated twice; of friction that is half believed the rest is observed."""

    def rub(rates: Array) -> Array:
        return -FRICTION.torque(rates)

    plain = followed(robot, scenario, compensated(robot, Compensation(TICK)), rub, 500)
    known = compensated(robot, Compensation(TICK, friction=FRICTION, bandwidth=BANDWIDTH))
    assert followed(robot, scenario, known, rub, 500) < 0.01 * plain
    np.testing.assert_allclose(estimate_of(known), 0.0, atol=2e-3)
    half = compensated(robot, Compensation(TICK, friction=HALF, bandwidth=BANDWIDTH))
    assert followed(robot, scenario, half, rub, 500) < 0.6 * plain
    left = -HALF.torque(np.full(14, 0.2 * np.sin(0.5)))
    first = np.delete(np.arange(14), [6, 13])  # the last joint of an arm is too light to follow so soon
    np.testing.assert_allclose(estimate_of(half)[BASE_NV:][first], left[first], rtol=0.1)


def test_what_was_found_stays_when_an_arm_takes_up_a_payload(robot: RobotModel, draw: Draw) -> None:
    """The momentum jumps, what acts does not: integral action and estimate go on from where they were."""
    compensation = Compensation(TICK, INTEGRAL, None, BANDWIDTH)
    law = NmpcLaw(robot, NmpcGains(1.0, 0), lambda known: compensated(known, compensation))
    q, v = draw.q(), draw.v(0.3)
    desired = np.array([q[BASE_NQ:] - 0.01, v[BASE_NV:], np.zeros(14)])
    for _ in range(20):
        law.effort(q, v, desired, TICK)
    before = law.efforts
    assert isinstance(before, CompensatedTorque) and before.action.min() > 0.0
    action, estimate = before.action, estimate_of(before)
    assert np.abs(estimate).max() > 0.01
    law.carry(robot)
    after = law.efforts
    assert isinstance(after, CompensatedTorque) and after is not before
    assert after.action.tobytes() == action.tobytes()
    law.effort(q, v, desired, TICK)
    np.testing.assert_allclose(estimate_of(after), estimate, rtol=1e-9, atol=1e-12)


ALL = {
    "disturbance_bandwidth": BANDWIDTH,
    "integral_time": 0.5,
    "friction_viscous": 0.02,
    "friction_coulomb": 0.01,
}


def test_a_compensated_run_goes_on_from_a_snapshot() -> None:
    """Under the closed form and the predictive law alike, and a run that is reset begins anew."""
    for law in ("nmpc", "mpc"):
        values = {"common.duration": 0.5, "law": law, "controller": ALL}
        loop, other = (Loop(load_scenario("paper", values)) for _ in range(2))
        first = [loop.advance_period().rows.effort.tobytes() for _ in range(4)]
        other.restore(loop.snapshot())
        for _ in range(2):
            one, two = loop.advance_period().rows, other.advance_period().rows
            assert one.effort.tobytes() == two.effort.tobytes()
        loop.reset()
        assert [loop.advance_period().rows.effort.tobytes() for _ in range(4)] == first


@pytest.mark.parametrize("name", ALL)
def test_a_law_without_a_model_compensates_for_nothing(name: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"{name} is .* must be 0 under control law 'pid'"):
        Loop(load_scenario("smooth", {"law": "pid", "controller": {name: ALL[name]}}))


def test_an_integral_time_of_an_unstable_loop_is_rejected() -> None:
    """Where the tick is too long for it."""
    values = {"law": "nmpc", "controller.integral_time": 1e-3}
    with pytest.raises(ConfigurationError, match="is unstable at the start"):
        Loop(load_scenario("smooth", values))
