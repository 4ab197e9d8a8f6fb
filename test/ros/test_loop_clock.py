"""Deadlines are absolute, whatever a tick takes; the report tells what happened since the last one."""

from math import sqrt

import pytest
from sms_handover_interfaces.msg import LoopTiming

from sms_handover.ros.loop_clock import LoopClock

TICK_S = 0.25  # s; with all times multiples of 1/16 s every sum here is exact
TICK_NS = 250_000_000


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
    monkeypatch.setattr("sms_handover.ros.loop_clock.monotonic", clock)
    return clock


@pytest.fixture
def paced(wall: WallClock) -> LoopClock:
    clock = LoopClock(TICK_NS, paced=True)
    clock.start()
    return clock


def test_nothing_is_due_before_the_start(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=True)
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
    clock = LoopClock(100 * TICK_NS, paced=True)
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


def test_after_a_long_halt_every_missed_tick_is_made_up_for(wall: WallClock, paced: LoopClock) -> None:
    wall.now += 10 * TICK_S
    made_up = 0
    while paced.due():
        paced.ticked()
        made_up += 1
    assert made_up == 10


@pytest.mark.parametrize(("behind", "late"), [(0.0, 0), (TICK_S, 0), (TICK_S + 0.0625, 1), (3 * TICK_S, 1)])
def test_a_tick_is_late_more_than_one_period_behind(
    wall: WallClock, paced: LoopClock, behind: float, late: int
) -> None:
    wall.now += TICK_S + behind
    paced.ticked()
    assert paced.report().late_ticks == late


def test_in_lock_step_nothing_is_due_or_late(wall: WallClock) -> None:
    clock = LoopClock(TICK_NS, paced=False)
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


def test_a_report_of_no_ticks_is_zero(wall: WallClock, paced: LoopClock) -> None:
    wall.now += 1.0
    report = paced.report()
    assert (report.ticks, report.period_mean, report.period_std, report.period_max) == (0, 0.0, 0.0, 0.0)
    assert report.real_time_factor == 0.0
