from collections.abc import Callable
from math import exp, isnan, log, pi, sqrt

import numpy as np
import pytest

from sms_handover.analysis.numbers import angle_between
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.settling import settling_time
from sms_handover.analysis.tracking import Motion, ToolTracking, tool_tracking
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

ONE_PHASE = PHASES[:1]
PERIOD = REFERENCE_NS / NS  # [s]


def track(tool: Path, target: Path, end: float = 20.0, *, reference_moves: bool = False) -> ToolTracking:
    run = make_run(end=end, phases=ONE_PHASE, tool={"arm_a": tool}, target={"arm_a": target})
    if reference_moves:
        moving = np.tile(np.linspace(0.0, 1.0, len(run.reference_ns))[:, np.newaxis], len(JOINTS))
        run = changed(run, reference_position=moving)
    return tool_tracking(run, phase_spans(run)[0], "arm_a")


def step_to(length: float, along: Callable[[Array], Array]) -> ToolTracking:
    direction = (1.0, -2.0, 0.5)
    return track(line(along, direction), line(lambda t: np.full(len(t), length), direction))


@pytest.mark.parametrize("damping", [0.2, 0.5, 0.68])
@pytest.mark.parametrize("length", [0.1, 0.4])
def test_overshoot_of_a_second_order_system(damping: float, length: float) -> None:
    found = step_to(length, second_order(length, damping, frequency=2.0))
    ratio = exp(-pi * damping / sqrt(1.0 - damping**2))
    assert found.motion is Motion.STEP
    assert found.step_length == pytest.approx(length)
    assert found.overshoot == pytest.approx(ratio * length, rel=1e-3)
    assert found.overshoot_ratio == pytest.approx(ratio, rel=1e-3)


def test_an_approach_from_one_side_does_not_overshoot() -> None:
    assert step_to(0.3, lambda t: 0.3 * (1.0 - np.exp(-t))).overshoot == 0.0


def test_an_error_to_the_side_is_no_overshoot() -> None:
    def tool(t: Array) -> Array:
        return np.column_stack([0.3 * (1.0 - np.exp(-t)), 0.1 * np.sin(t), 0.0 * t])

    found = track(tool, still((0.3, 0.0, 0.0)))
    assert found.overshoot == 0.0
    assert found.largest_error > 0.1


@pytest.mark.parametrize(
    ("length", "band"), [(0.4, 0.008), (0.05, 0.001), (0.02, 0.001)], ids=["ratio", "both", "floor"]
)
def test_settling_of_a_first_order_system(length: float, band: float) -> None:
    found = step_to(length, lambda t: length * (1.0 - np.exp(-t / 1.5)))
    exact = 1.5 * log(length / band)
    assert found.band == pytest.approx(band)
    assert exact <= found.settling_time <= exact + PERIOD


def test_settling_of_a_second_order_system_is_its_last_way_into_the_band() -> None:
    damping, frequency = 0.3, 2.0
    response = second_order(1.0, damping, frequency)
    found = step_to(1.0, response)
    # the extrema are at multiples of half a period, of size exp(-k pi zeta / sqrt(1 - zeta^2))
    ratio = exp(-pi * damping / sqrt(1.0 - damping**2))
    last = next(k for k in range(100) if ratio ** (k + 1) < 0.02)
    low, high = (k * pi / (frequency * sqrt(1.0 - damping**2)) for k in (last, last + 1))
    for _ in range(60):
        middle = (low + high) / 2
        outside = abs(response(np.array([middle]))[0] - 1.0) > 0.02
        low, high = (middle, high) if outside else (low, middle)
    assert low <= found.settling_time <= low + PERIOD


def test_a_tool_that_leaves_its_band_again_settles_after_that() -> None:
    found = step_to(0.4, lambda t: 0.4 + 0.4 * (t < 1.0) + 0.009 * ((t > 11.0) & (t < 12.0)))
    assert found.settling_time == pytest.approx(12.0, abs=PERIOD)


@pytest.mark.parametrize("late", [0.0, 19.99])
def test_a_tool_outside_its_band_at_the_end_never_settles(late: float) -> None:
    found = step_to(0.4, lambda t: np.where(t >= late, 0.41, 0.4) * (t > 0.0))
    assert isnan(found.settling_time)


def test_a_tool_on_its_target_has_settled_at_once() -> None:
    found = track(still(), still())
    assert (found.settling_time, found.largest_error) == (0.0, 0.0)


def test_the_border_of_the_band_belongs_to_it() -> None:
    stamps = np.array([0, NS, 2 * NS], dtype=np.int64)
    assert settling_time(stamps, np.array([2.0, 1.0, 1.0]), 1.0, 0) == 1.0


def test_errors_over_time_are_those_of_the_tool() -> None:
    found = step_to(0.4, lambda t: 0.4 * (1.0 - np.exp(-t)))
    t = found.stamp_ns / NS
    assert np.allclose(found.position_error, 0.4 * np.exp(-t), atol=1e-15)
    assert found.final_error == pytest.approx(0.4 * exp(-20.0))
    assert found.largest_error == pytest.approx(0.4)


def test_arrays_are_read_only() -> None:
    found = step_to(0.4, lambda t: t)
    for array in (found.stamp_ns, found.position_error, found.orientation_error):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_steady_state_error_is_the_mean_over_the_last_tenth() -> None:
    # |e| falls linearly from 20 mm to 0 over 20 s, so its mean over the last 2 s is 1 mm
    found = step_to(0.02, lambda t: 0.02 * t / 20.0)
    assert found.steady_state_error == pytest.approx(1e-3, rel=1e-9)
    assert found.final_error == pytest.approx(0.0, abs=1e-15)


def test_overshoot_is_measured_against_a_target_that_moves() -> None:
    def target(t: Array) -> Array:
        return np.column_stack([0.3 + 0.01 * t, 0.0 * t, 0.0 * t])

    response = second_order(0.3, 0.5, 2.0)
    found = track(lambda t: np.column_stack([response(t) + 0.01 * t, 0.0 * t, 0.0 * t]), target)
    assert found.step_length == pytest.approx(0.3)
    assert found.overshoot_ratio == pytest.approx(exp(-pi * 0.5 / sqrt(0.75)), rel=1e-3)


def test_a_step_back_overshoots_backwards() -> None:
    response = second_order(0.3, 0.5, 2.0)
    found = track(line(lambda t: -response(t)), still((-0.3, 0.0, 0.0)))
    assert found.overshoot_ratio == pytest.approx(exp(-pi * 0.5 / sqrt(0.75)), rel=1e-3)


def smooth(t: Array) -> Array:
    x = np.clip(t / 10.0, 0.0, 1.0)
    return np.asarray(0.4 * (10 * x**3 - 15 * x**4 + 6 * x**5))


def test_a_smooth_motion_overshoots_past_where_it_ends() -> None:
    def tool(t: Array) -> Array:
        return smooth(t) + np.where(t >= 10.0, 0.03 * np.sin((t - 10.0) * pi / 10.0), 0.002)

    found = track(line(lambda t: tool(t) - 0.002), line(smooth), reference_moves=True)
    assert found.motion is Motion.SMOOTH
    assert found.step_length == pytest.approx(0.4)
    assert found.overshoot == pytest.approx(0.028, rel=1e-6)


def test_a_tool_that_leads_a_smooth_target_does_not_overshoot() -> None:
    found = track(
        line(lambda t: smooth(t + 0.5) - smooth(np.array([0.5]))), line(smooth), reference_moves=True
    )
    assert found.motion is Motion.SMOOTH
    assert found.largest_error > 1e-2
    assert found.overshoot == 0.0


def test_a_smooth_motion_settles_where_it_ends_not_on_its_way() -> None:
    found = track(line(smooth), line(smooth), reference_moves=True)  # never off its target
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if smooth(np.array([middle]))[0] < 0.98 * 0.4 else (low, middle)
    assert found.largest_error == 0.0
    assert low <= found.settling_time <= low + PERIOD


def test_a_held_arm_has_no_step_to_overshoot() -> None:
    # the base carries the target of held joints away, and the tool swings about it
    swing = second_order(0.01, 0.3, 2.0)
    found = track(line(lambda t: smooth(t) + 0.01 - swing(t) - 0.01 * np.exp(-50 * t)), line(smooth))
    assert found.motion is Motion.HOLD
    assert isnan(found.overshoot)
    assert isnan(found.overshoot_ratio)
    assert found.band == 1e-3
    assert 0.0 < found.settling_time < 20.0


def test_keeping_a_place_in_the_world_is_a_hold_too() -> None:
    assert track(still(), still(), reference_moves=True).motion is Motion.HOLD


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.3, 3.0, pi])
def test_orientation_error_is_the_angle_of_the_relative_turn(angle: float) -> None:
    run = make_run(end=1.0, phases=ONE_PHASE)
    n = len(run.reference_ns)
    target = turns(np.full(n, 0.7), (1.0, 2.0, 3.0))
    tool = turns(np.full(n, 0.7 + angle), (1.0, 2.0, 3.0))
    tool[::2] *= -1.0  # q and -q are the same turn
    run = changed(
        run,
        target_pose={**run.target_pose, "arm_a": poses(np.zeros((n, 3)), target)},
        tool_pose={**run.tool_pose, "arm_a": poses(np.zeros((n, 3)), tool)},
    )
    found = tool_tracking(run, phase_spans(run)[0], "arm_a")
    assert np.allclose(found.orientation_error, angle, rtol=1e-9, atol=1e-15)
    assert found.final_orientation_error == pytest.approx(angle, rel=1e-9, abs=1e-15)


def test_the_angle_between_turns_about_different_axes() -> None:
    quarter_x, quarter_y = (turns(np.array([pi / 2]), axis) for axis in ((1, 0, 0), (0, 1, 0)))
    assert angle_between(quarter_x, quarter_y) == pytest.approx(2 * pi / 3)


def test_rows_that_were_not_recorded_are_left_out() -> None:
    whole = step_to(0.4, lambda t: 0.4 * (1.0 - np.exp(-t)))
    run = make_run(
        end=20.0,
        phases=ONE_PHASE,
        tool={"arm_a": line(lambda t: np.where((t > 3.0) & (t < 3.5), np.nan, 0.4 * (1.0 - np.exp(-t))))},
        target={"arm_a": still((0.4, 0.0, 0.0))},
    )
    found = tool_tracking(run, phase_spans(run)[0], "arm_a")
    assert len(found.stamp_ns) == len(whole.stamp_ns) - 24
    assert found.settling_time == whole.settling_time
    assert found.steady_state_error == pytest.approx(whole.steady_state_error)


def test_an_arm_that_was_not_recorded_has_no_figures() -> None:
    found = track(still((np.nan, 0.0, 0.0)), still())
    assert found.stamp_ns.size == 0
    for value in (found.overshoot, found.settling_time, found.final_error, found.steady_state_error):
        assert isnan(value)
