from math import exp, isnan, log, pi, sqrt

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.analysis.orientation import TURN_FLOOR, OrientationTracking
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.tracking import tool_tracking
from sms_handover.types import Array

from .test_analysis_runs import (
    JOINTS,
    NS,
    PHASES,
    REFERENCE_NS,
    Path,
    changed,
    line,
    make_run,
    poses,
    second_order,
    still,
    turns,
)

PERIOD = REFERENCE_NS / NS  # [s]
AXIS = (1.0, -2.0, 0.5)
DEG = pi / 180.0
PLACE = still((1.0, 2.0, 3.0))


def product(a: Array, b: Array) -> Array:
    return np.asarray((pin.Quaternion(a) * pin.Quaternion(b)).coeffs())


def track(tool: Array, target: Array, place: Path = PLACE, *, smooth: bool = False) -> OrientationTracking:
    """Return the tracking of quaternions (R, 4) over 20 s; the position has no error."""
    run = make_run(end=20.0, phases=PHASES[:1])
    t = run.reference_ns / NS
    rows = {"tool_pose": poses(place(t), tool), "target_pose": poses(place(t), target)}
    run = changed(run, **{name: {**getattr(run, name), "arm_a": both} for name, both in rows.items()})
    if smooth:
        moving = np.tile(np.linspace(0.0, 1.0, len(t))[:, np.newaxis], len(JOINTS))
        run = changed(run, reference_position=moving)
    return tool_tracking(run, phase_spans(run)[0], "arm_a").orientation


def times() -> Array:
    return np.arange(0, 20 * NS + 1, REFERENCE_NS) / NS


def step_of(angle: Array, goal: float) -> OrientationTracking:
    """Return the tracking of a turn about one axis to a goal, both seen from a tilted world."""
    tilt = np.array([0.5, -0.5, 0.5, 0.5])
    tool = np.array([product(tilt, row) for row in turns(angle, AXIS)])
    target = np.array([product(tilt, row) for row in turns(np.full(len(angle), goal), AXIS)])
    return track(tool, -target)  # q and -q are the same orientation


@pytest.mark.parametrize("damping", [0.2, 0.5, 0.68])
@pytest.mark.parametrize("goal", [5 * DEG, 60 * DEG])
def test_overshoot_of_a_second_order_system(damping: float, goal: float) -> None:
    found = step_of(second_order(goal, damping, frequency=2.0)(times()), goal)
    ratio = exp(-pi * damping / sqrt(1.0 - damping**2))
    assert found.step_angle == pytest.approx(goal)
    assert found.overshoot == pytest.approx(ratio * goal, rel=1e-3)
    assert found.overshoot_ratio == pytest.approx(ratio, rel=1e-3)
    assert found.largest_error == pytest.approx(goal)


@pytest.mark.parametrize(("goal", "band"), [(60 * DEG, 1.2 * DEG), (5 * DEG, TURN_FLOOR)])
def test_settling_and_steady_state_of_a_first_order_system(goal: float, band: float) -> None:
    found = step_of(goal * (1.0 - np.exp(-times() / 1.5)), goal)
    exact = 1.5 * log(goal / band)
    assert found.band == pytest.approx(band)
    assert exact <= found.settling_time <= exact + PERIOD
    assert found.overshoot == 0.0
    late = times()[times() >= 18.0]
    assert found.steady_state_error == pytest.approx(goal * np.mean(np.exp(-late / 1.5)), rel=1e-6)


def test_a_tool_that_need_not_turn_has_no_overshoot_but_a_largest_error() -> None:
    swing = 3.0 * DEG * np.exp(-times()) * np.sin(times())
    found = track(turns(swing, AXIS), turns(0.0 * swing))
    assert isnan(found.overshoot) and isnan(found.overshoot_ratio)
    assert found.step_angle == 0.0
    assert found.largest_error == pytest.approx(swing.max())
    inside = times()[np.abs(swing) > TURN_FLOOR][-1]
    assert found.settling_time == pytest.approx(inside + PERIOD)


def test_a_turn_about_another_axis_is_no_overshoot() -> None:
    """The tool comes to its goal from one side, while it sways across that way."""
    goal = 20 * DEG
    ahead = turns(goal * (1.0 - np.exp(-times())), (1.0, 0.0, 0.0))
    sway = turns(2 * DEG * np.sin(times()), (0.0, 1.0, 0.0))
    tool = np.array([product(a, b) for a, b in zip(sway, ahead, strict=True)])
    found = track(tool, turns(np.full(len(times()), goal), (1.0, 0.0, 0.0)))
    assert found.overshoot < 0.01 * DEG  # small turns about two axes nearly commute
    assert found.largest_error > 2 * DEG


def test_after_a_smooth_turn_the_goal_is_where_the_target_ends() -> None:
    goal = 0.5
    target = goal * np.clip(times() / 10.0, 0.0, 1.0)
    away = line(lambda t: 0.03 * t)
    tool = goal * np.clip((times() + 1.0 * (times() > 1.0)) / 10.0, 0.0, 1.0)  # leads, ends where it shall
    found = track(turns(tool, AXIS), turns(target, AXIS), away, smooth=True)
    assert found.overshoot == 0.0
    assert found.step_angle == pytest.approx(goal)
    assert found.largest_error == pytest.approx(goal / 10.0)
    # the tool arrives at 9 s; it is in the band of 2 % a fiftieth of the way earlier
    assert found.settling_time == pytest.approx(9.0 - 0.02 * 10.0, abs=PERIOD)


def test_an_orientation_outside_its_band_at_the_end_never_settles() -> None:
    off = turns(np.full(len(times()), 1.1 * TURN_FLOOR), AXIS)
    assert isnan(track(off, turns(np.zeros(len(times())))).settling_time)


def test_a_phase_without_a_recorded_pose_has_nan() -> None:
    lost = np.full((len(times()), 4), np.nan)
    found = track(lost, turns(np.zeros(len(times()))))
    for value in (found.step_angle, found.overshoot, found.settling_time, found.largest_error):
        assert isnan(value)
