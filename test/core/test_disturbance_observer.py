"""The disturbance observer: it finds what acts, at its own pace, and takes it off."""

import numpy as np

from sms_handover.control.computed_torque import ComputedTorque, TrackingEfforts
from sms_handover.control.disturbance_observer import ObservedTorque
from sms_handover.model.robot_model import BASE_NQ, RobotModel
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.wiring import make_plant

BANDWIDTH, TICK = 20.0, 1e-3  # [1/s], [s]


def test_a_constant_torque_is_found_and_taken_off(robot: RobotModel, scenario: Scenario) -> None:
    """Behind a lag of 1/K, while the arms move; the error it leaves without the observer is d / (k_p H*)."""
    parameters = scenario.parameters
    disturbance = np.zeros(14)
    disturbance[[1, 8]] = 0.3, -0.2  # N m
    feedback = np.repeat([[40.0], [12.0]], 14, axis=1)
    observed = ObservedTorque(robot, ComputedTorque(robot), BANDWIDTH, TICK)
    errors = {}
    torques: dict[str, TrackingEfforts] = {"observed": observed, "plain": ComputedTorque(robot)}
    for name, torque in torques.items():
        plant = make_plant(robot, scenario.truth.schedule, parameters.common, parameters.plant)
        start = np.array(plant.q[BASE_NQ:])
        for tick in range(1500):
            phase = tick * TICK
            desired = np.array([start + 0.2 * np.sin(phase), np.full(14, 0.2 * np.cos(phase)), np.zeros(14)])
            desired[2] = -0.2 * np.sin(phase)
            plant.apply(torque(plant.q, plant.v, desired, feedback) + disturbance)
            if tick == 50 and name == "observed":
                share = observed.estimate[[7, 14]] / disturbance[[1, 8]]
                np.testing.assert_allclose(share, 1.0 - np.exp(-BANDWIDTH * tick * TICK), atol=0.02)
        errors[name] = np.abs(plant.q[BASE_NQ:] - start - 0.2 * np.sin(1.5)).max()
    np.testing.assert_allclose(observed.estimate[6:], disturbance, atol=2e-3)
    np.testing.assert_allclose(observed.estimate[:6], 0.0, atol=2e-3)
    assert errors["observed"] < 0.05 * errors["plain"]


def test_a_run_with_an_observer_goes_on_from_a_snapshot() -> None:
    """Under the closed form and the predictive law alike."""
    for law in ("nmpc", "mpc"):
        values = {"common.duration": 0.5, "law": law, "controller.disturbance_bandwidth": BANDWIDTH}
        loop, other = (Loop(load_scenario("paper", values)) for _ in range(2))
        for _ in range(4):
            loop.advance_period()
        other.restore(loop.snapshot())
        for _ in range(2):
            one, two = loop.advance_period().rows, other.advance_period().rows
            assert one.effort.tobytes() == two.effort.tobytes()
