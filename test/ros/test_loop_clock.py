"""Deadlines are absolute, whatever a tick takes; the report tells what happened since the last one."""

from math import sqrt

import pytest
from sms_handover_interfaces.msg import LoopTiming

from sms_handover.ros.transport.loop_clock import LATENCY_BIN_S, LATENCY_BINS, LoopClock

TICK_S = 0.25  # s; with all times multiples of 1/16 s every sum here is exact
TICK_NS = 250_000_000
CATCH_UP_S = 2.5  # s


class WallClock:
    """A clock that moves when told to."""

    def __init__(self) -> None:
        """Start somewhere."""
        self.now = 1000.0

    def __call__(self) -> float:
        """Return the time in s."""
        return self.now


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> WallClock:
    clock = WallClock()
    monkeypatch.setattr("sms_handover.ros.transport.loop_clock.monotonic", clock)
    return clock


@pytest.fixture
def paced(wall: WallClock) -> LoopClock:
    clock = LoopClock(TICK_NS, paced=True, catch_up_s=CATCH_UP_S)
    clock.start()
    return clock


def test_nothing_is_due_before_the_start(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=True, catch_up_s=CATCH_UP_S)
    wall.now += 100.0
    assert not clock.due()
    assert clock.wait_s() > 0.0


def test_first_tick_is_due_one_period_after_the_start(wall: WallClock, paced: LoopClock) -> None:
    assert not paced.due()
    wall.now += TICK_S - 0.0625
    assert not paced.due()
    assert paced.wait_s() == 0.0625
    wall.now += 0.0625
    assert paced.due()
    assert paced.wait_s() == 0.0


def test_the_wait_is_short_enough_to_notice_other_things(wall: WallClock) -> None:
    clock = LoopClock(100 * TICK_NS, paced=True, catch_up_s=CATCH_UP_S)
    clock.start()
    assert 0.0 < clock.wait_s() <= 0.5


def test_deadlines_do_not_drift(wall: WallClock, paced: LoopClock) -> None:
    """A tick that begins late does not put off the next: the deadlines stay one period apart."""
    begin = wall.now
    for number in range(1, 200):
        wall.now = begin + number * TICK_S + 0.0625 * (number % 4)
        assert paced.due()
        paced.ticked()
        next_in = begin + (number + 1) * TICK_S - wall.now
        assert not paced.due()
        assert paced.wait_s() == min(next_in, 0.1)


@pytest.mark.parametrize(
    ("lag", "made_up", "skipped"),
    [(CATCH_UP_S, 11, 0.0), (CATCH_UP_S + 0.0625, 1, CATCH_UP_S + 0.0625), (5000 * TICK_S, 1, 5000 * TICK_S)],
)
def test_after_a_halt_lag_is_made_up_for_or_skipped_if_there_is_too_much(
    wall: WallClock, paced: LoopClock, lag: float, made_up: int, skipped: float
) -> None:
    """The tick that is due comes at once; behind a skip the next one is due a period later."""
    wall.now += TICK_S + lag
    ticks = 0
    while paced.due():
        paced.ticked()
        ticks += 1
    assert (ticks, paced.skipped_s) == (made_up, skipped)
    assert paced.wait_s() > 0.0
    wall.now += TICK_S
    assert paced.due()
    paced.ticked()
    assert not paced.due()
    assert (f"{skipped:.3g} s of lag were skipped" in paced.misses) is (skipped > 0.0)


def test_skipped_lag_is_reported_once_a_second_and_none_of_it_is_lost(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=True, catch_up_s=TICK_S)
    clock.start()
    assert clock.take_skipped() == 0.0
    reported = []
    for _ in range(5):
        wall.now += TICK_S + 0.3125
        clock.ticked()
        reported.append(clock.take_skipped())
    assert reported == [0.3125, 0.0, 0.625, 0.0, 0.625]
    assert sum(reported) == clock.skipped_s
    clock.reset()
    assert (clock.skipped_s, clock.misses) == (0.0, "")


@pytest.mark.parametrize(("behind", "late"), [(0.0, 0), (TICK_S, 0), (TICK_S + 0.0625, 1), (3 * TICK_S, 1)])
def test_a_tick_is_late_more_than_one_period_behind(
    wall: WallClock, paced: LoopClock, behind: float, late: int
) -> None:
    wall.now += TICK_S + behind
    paced.ticked()
    assert paced.report().late_ticks == late


def test_in_lock_step_nothing_is_due_or_late(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=False, catch_up_s=CATCH_UP_S)
    clock.start()
    wall.now += 100.0
    assert not clock.due()
    clock.ticked()
    report = clock.report()
    assert (report.ticks, report.late_ticks, report.held_commands) == (1, 0, 0)


def test_a_pause_is_not_a_late_tick(wall: WallClock, paced: LoopClock) -> None:
    wall.now += TICK_S
    paced.ticked()
    wall.now += 100.0
    paced.start()
    assert not paced.due()
    wall.now += TICK_S
    assert paced.due()
    paced.ticked()
    report = paced.report()
    assert (report.ticks, report.late_ticks, report.period_max) == (2, 0, TICK_S)


def test_a_stopped_clock_has_nothing_due(wall: WallClock, paced: LoopClock) -> None:
    wall.now += TICK_S
    assert paced.due()
    paced.stop()
    wall.now += 100.0
    assert not paced.due()
    assert paced.wait_s() > 0.0  # a loop that waits so long does not spin
    paced.start()
    wall.now += TICK_S
    assert paced.due()


def test_held_commands_are_counted(wall: WallClock, paced: LoopClock) -> None:
    for held in (False, True, True):
        wall.now += TICK_S
        paced.ticked(held=held)
    assert paced.report().held_commands == 2


def test_report_has_the_statistics_since_the_last_one(wall: WallClock, paced: LoopClock) -> None:
    wall.now += 50.0
    paced.ticked()
    paced.report()
    periods = [0.25, 0.5, 0.25, 1.0]
    for period in periods:
        wall.now += period
        paced.ticked()
    report = paced.report()
    assert isinstance(report, LoopTiming)
    mean = sum(periods) / 4
    variance = sum((period - mean) ** 2 for period in periods) / 4
    assert report.ticks == 5  # since the start
    assert report.period_mean == mean
    assert report.period_std == pytest.approx(sqrt(variance), rel=1e-12)
    assert report.period_max == 1.0
    assert report.real_time_factor == 4 * TICK_S / sum(periods)


def test_99_of_100_periods_are_off_by_no_more_than_told(wall: WallClock, paced: LoopClock) -> None:
    """Too early counts as too late does."""
    errors = [0.0] * 98 + [-0.125, 1.0]
    for error in errors[::7] + [e for k, e in enumerate(errors) if k % 7]:
        wall.now += TICK_S + error
        paced.ticked()
    assert paced.report().period_error_p99 == 0.125


def test_work_lasts_from_the_tick_to_its_state(wall: WallClock, paced: LoopClock) -> None:
    for work in (0.0625, 0.125, 0.0625, 0.0):
        wall.now += TICK_S
        paced.ticked()
        wall.now += work
        paced.published()
    report = paced.report()
    assert (report.execution_mean, report.execution_max) == (0.0625, 0.125)


def test_latencies_fall_into_bins_and_none_is_lost(wall: WallClock, paced: LoopClock) -> None:
    bins = [0, 0, 1, 3, 39, 40, 1000]
    for number in bins:
        wall.now = 1000.0  # whence the bins' borders are far from a rounding error
        paced.published()
        wall.now += (number + 0.5) * LATENCY_BIN_S
        paced.answered()
    report = paced.report()
    counts = list(report.latency_counts)
    assert len(counts) == LATENCY_BINS and sum(counts) == len(bins)
    assert {k: n for k, n in enumerate(counts) if n} == {0: 2, 1: 1, 3: 1, 39: 1, 40: 2}
    assert report.latency_bin == LATENCY_BIN_S
    assert report.latency_max == pytest.approx(1000.5 * LATENCY_BIN_S, rel=1e-6)


KHZ_NS = 1_000_000


@pytest.mark.parametrize(
    ("period", "work", "level", "words"),
    [
        (1.0 / 1004.0, 0.0, 0, ""),
        (1.0 / 994.0, 0.0, 1, "994 Hz instead of 1000 Hz"),
        (1.0 / 1006.0, 0.0, 1, "1006 Hz instead of 1000 Hz"),
        (1.0 / 989.0, 0.0, 2, "989 Hz instead of 1000 Hz"),
        (1e-3, 0.0009, 0, ""),
        (1e-3, 0.0011, 1, "a tick takes 1100 us"),
        (1e-3, 0.0021, 2, "a tick takes 2100 us"),
        (1.0 / 500.0, 0.0011, 2, "500 Hz instead of 1000 Hz, a tick takes 1100 us"),
    ],
)
def test_diagnosis_has_the_thresholds_of_ros2_control(
    wall: WallClock, period: float, work: float, level: int, words: str
) -> None:
    """Off the rate by 5 and 10 Hz, 1 and 2 ms of work: warning and error."""
    clock = LoopClock(KHZ_NS, paced=True, catch_up_s=CATCH_UP_S)
    clock.start()
    for _ in range(50):
        begin = wall.now
        wall.now = begin + period
        clock.ticked()
        wall.now += work
        clock.published()
        wall.now = begin + period
    clock.report()
    assert clock.diagnosis == (level, words)


def test_in_lock_step_no_rate_is_wrong(wall: WallClock) -> None:
    clock = LoopClock(KHZ_NS, paced=False, catch_up_s=CATCH_UP_S)
    clock.start()
    wall.now += 1.0
    clock.ticked()
    clock.report()
    assert clock.diagnosis == (0, "")


def test_what_real_time_has_cost_is_told_with_what_to_do(wall: WallClock, paced: LoopClock) -> None:
    wall.now += TICK_S
    paced.ticked()
    assert paced.misses == ""
    wall.now += 3 * TICK_S
    paced.ticked(held=True)
    assert paced.misses == (
        "real time was not kept: of 2 ticks 1 began more than a tick late and 1 held an old command; "
        "run in lock step, or with a longer tick"
    )


def test_a_report_of_no_ticks_is_zero(wall: WallClock, paced: LoopClock) -> None:
    wall.now += 1.0
    report = paced.report()
    assert (report.ticks, report.period_mean, report.period_std, report.period_max) == (0, 0.0, 0.0, 0.0)
    assert report.real_time_factor == 0.0


def test_the_time_a_run_has_taken_leaves_pauses_out(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=False, catch_up_s=CATCH_UP_S)
    wall.now += 7.0
    assert clock.ran == 0.0
    clock.start()
    wall.now += 2.0
    assert clock.ran == 2.0
    clock.stop()
    wall.now += 30.0
    assert clock.ran == 2.0
    clock.start()
    wall.now += 0.5
    assert clock.ran == 2.5


def test_a_reset_counts_the_time_of_a_run_anew(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=False, catch_up_s=CATCH_UP_S)
    clock.start()
    wall.now += 2.0
    clock.reset()
    clock.start()
    wall.now += 0.5
    assert clock.ran == 0.5
    clock.stop()
    clock.reset()
    wall.now += 1.0
    assert clock.ran == 0.0
