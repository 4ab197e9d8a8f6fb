from collections.abc import Callable
from math import isnan, nan, pi

import numpy as np
import pytest

from sms_handover.analysis.base_motion import BaseMotion, base_motion
from sms_handover.analysis.metrics import common_settling, measure
from sms_handover.analysis.phases import phase_spans
from sms_handover.run_data import RunData
from sms_handover.types import Array

from .test_analysis_runs import NS, changed, line, make_run, poses, still, turns

VELOCITY = np.array([3e-5, -4e-5, 0.0])  # [m/s] of size 5e-5
TURN_RATE = 2e-4  # [rad/s]


def moving(
    position: Callable[[Array], Array], velocity: Callable[[Array], Array], turn_rate: float = 0.0
) -> RunData:
    run = make_run()
    t = run.tick_ns / NS
    axis = np.array([1.0, 1.0, -1.0])
    rates = np.tile(turn_rate * axis / np.linalg.norm(axis), (len(t), 1))
    pose = poses(position(t), turns(turn_rate * t, (1.0, 1.0, -1.0)))
    return changed(run, base_pose=pose, base_twist=np.column_stack([velocity(t), rates]))


def drifting() -> RunData:
    return moving(
        lambda t: t[:, np.newaxis] * VELOCITY, lambda t: np.tile(VELOCITY, (len(t), 1)), turn_rate=TURN_RATE
    )


def motion_of(run: RunData, begin: float = 0.0) -> BaseMotion:
    return base_motion(run, phase_spans(run)[1], begin)


@pytest.mark.parametrize("begin", [0.0, 7.3, 19.9])
def test_a_steady_drift_has_its_rate_in_every_window(begin: float) -> None:
    found = motion_of(drifting(), begin)
    assert found.duration == pytest.approx(20.0 - begin)
    assert found.position_change == pytest.approx(5e-5 * (20.0 - begin))
    assert found.attitude_change == pytest.approx(TURN_RATE * (20.0 - begin))
    assert (found.position_rate, found.mean_speed) == pytest.approx((5e-5, 5e-5))
    assert (found.attitude_rate, found.mean_turn_rate) == pytest.approx((TURN_RATE, TURN_RATE))


def test_a_swing_about_a_place_is_no_drift_but_has_a_speed() -> None:
    size, frequency = 1e-3, pi  # whole periods of 2 s in 20 s
    found = motion_of(
        moving(
            line(lambda t: size * np.sin(frequency * t)),
            line(lambda t: size * frequency * np.cos(frequency * t)),
        )
    )
    assert found.position_rate == pytest.approx(0.0, abs=1e-15)
    assert found.mean_speed == pytest.approx(2.0 / pi * size * frequency, rel=1e-4)


@pytest.mark.parametrize("begin", [20.0, 25.0, nan])
def test_a_window_without_two_states_has_no_motion(begin: float) -> None:
    found = motion_of(drifting(), begin)
    assert all(isnan(value) for value in (found.duration, found.position_rate, found.mean_turn_rate))


@pytest.mark.parametrize("lost", [slice(2000, 2500), slice(2500, 3500), slice(3500, 4001)])
@pytest.mark.parametrize("field", ["base_pose", "base_twist"])
def test_states_that_were_not_recorded_are_left_out(field: str, lost: slice) -> None:
    run = drifting()
    rows = np.array(getattr(run, field))
    rows[lost] = nan
    found = motion_of(changed(run, **{field: rows}))
    assert (found.position_rate, found.mean_speed) == pytest.approx((5e-5, 5e-5))
    assert found.duration == pytest.approx(20.0 if lost.start == 2500 else 15.0, abs=0.02)


def settling_at(a: float, b: float) -> RunData:
    """Return a run in which each tool reaches its target at once that long after each phase begins."""

    def tool(late: float) -> Callable[[Array], Array]:
        return line(lambda t: (t // 20.0) - 1.0 + (t % 20.0 >= late))

    target = line(lambda t: t // 20.0)
    still_last = {"arm_a": target, "arm_b": target}
    return make_run(end=59.98, tool={"arm_a": tool(a), "arm_b": tool(b)}, target=still_last)


def test_a_phase_has_settled_when_its_last_tool_has() -> None:
    assert [item.settling_time for item in measure(settling_at(3.0, 5.0)).phases] == pytest.approx([5.0] * 3)


def test_a_phase_in_which_one_tool_never_settles_never_settles() -> None:
    assert all(isnan(item.settling_time) for item in measure(settling_at(3.0, 30.0)).phases)


def test_the_common_window_begins_when_the_slowest_run_has_settled() -> None:
    runs = [measure(settling_at(a, b)) for a, b in ((3.0, 5.0), (7.0, 2.0), (1.0, 30.0))]
    assert common_settling(runs, "carry") == pytest.approx(7.0)
    assert isnan(common_settling(runs[2:], "carry"))
    assert isnan(common_settling(runs, "no such phase"))


def test_drift_is_measured_only_once_the_run_itself_has_settled() -> None:
    run = measure(changed(drifting(), **poses_of(settling_at(3.0, 5.0))))
    assert run.drift("carry", 5.0).position_rate == pytest.approx(5e-5)
    assert isnan(run.drift("carry", 4.9).position_rate)
    assert isnan(run.drift("no such phase", 5.0).position_rate)


def poses_of(run: RunData) -> dict[str, object]:
    longer = make_run()
    short = len(longer.reference_ns) - len(run.reference_ns)
    return {
        name: {arm: np.vstack([rows, rows[[-1] * short]]) for arm, rows in getattr(run, name).items()}
        for name in ("tool_pose", "target_pose")
    }


def test_a_run_that_stands_still_has_settled_at_once_and_does_not_drift() -> None:
    run = measure(make_run(tool={"arm_a": still()}))
    assert run.drift("approach", 0.0).position_rate == 0.0
