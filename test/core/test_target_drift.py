"""Drift of previewed targets: exact where it is steady, and little of what only jumps."""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.poses import pose_of
from sms_handover.trajectory.target_drift import change_of, low_passed
from sms_handover.types import Pose, Twist

PERIOD, HORIZON = 0.02, 1.6  # [s]


def drifts(corrections: list[Pose]) -> list[Twist]:
    """Return the drift after each correction, a period apart."""
    found = [Twist(np.zeros(3), np.zeros(3))]
    for index in range(1, len(corrections)):
        change = change_of(corrections[index - 1], corrections[index], PERIOD)
        found.append(low_passed(found[-1], change, PERIOD, index * PERIOD))
    return found[1:]


def test_a_steady_drift_is_known_from_its_first_period() -> None:
    """Of a shift and a turn at constant rates, in axes of world."""
    linear, angular = np.array([0.01, -0.02, 0.03]), np.array([0.05, 0.0, -0.02])
    steady = [
        pose_of(pin.SE3(pin.exp3(PERIOD * k * angular), PERIOD * k * linear + [1.0, 0.0, 0.0]))
        for k in range(6)
    ]
    for drift in drifts(steady):
        assert drift.linear == pytest.approx(linear, abs=1e-12)
        assert drift.angular == pytest.approx(angular, abs=1e-12)


def test_measurements_that_jump_lead_targets_astray_by_no_more_than_some_jumps() -> None:
    """Of 2 mm each 0.1 s; their difference over a period, gone on with, would be eighty times as much."""
    jumps = np.repeat(0.002 * np.random.default_rng(0).standard_normal((200, 3)), 5, axis=0)  # m
    found = drifts([Pose(jump, np.array([0.0, 0.0, 0.0, 1.0])) for jump in jumps])
    astray = HORIZON * np.array([drift.linear for drift in found[50:]])
    assert astray.std() < 5 * 0.002
    assert np.abs(astray.mean(axis=0)).max() < 0.002
