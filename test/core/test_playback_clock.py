"""Bag time against wall time: the integral of the rate while the clock runs."""

from fractions import Fraction
from random import Random

import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.playback.clock import PlaybackClock

S = 1_000_000_000  # ns


def test_bag_time_is_the_integral_of_the_rate() -> None:
    """Against a sum over many random pieces of time, each at one rate or standing still."""
    random = Random(1)
    now, ran = 7 * S, 0
    bag = Fraction(3 * S)
    clock = PlaybackClock(3 * S, now)
    rate, paused = 1.0, False
    for pieces in range(1, 500):
        step = random.randrange(1, S)
        now += step
        bag += 0 if paused else step * Fraction(rate)
        ran += 0 if paused else step
        assert abs(clock.bag_ns(now) - bag) <= pieces  # each piece is rounded to a whole ns
        assert clock.ran_ns(now) == ran
        act = random.choice(("pause", "resume", "rate", "jump", "look"))
        if act == "pause":
            clock.pause(now)
            paused = True
        elif act == "resume":
            clock.resume(now)
            paused = False
        elif act == "rate":
            rate = random.choice((0.1, 0.5, 1.0, 3.0, 10.0))
            clock.set_rate(rate, now)
        elif act == "jump":
            bag = Fraction(random.randrange(100 * S))
            clock.jump(int(bag), now)
        assert (clock.rate, clock.paused) == (rate, paused)
        assert abs(clock.bag_ns(now) - bag) <= pieces


@pytest.mark.parametrize("rate", [0.3, 1.0, 7.0])
def test_after_the_wait_the_time_has_come_and_not_before(rate: float) -> None:
    clock = PlaybackClock(0, 0, rate=rate)
    for target in (1, 999, 123_456_789, 5 * S):
        wait = clock.wait_ns(target, 0)
        assert wait
        assert clock.bag_ns(wait) == pytest.approx(target, abs=rate + 1)
        assert clock.wait_ns(target, wait + 2) == 0


def test_a_paused_clock_waits_for_ever_but_not_for_what_has_been() -> None:
    clock = PlaybackClock(5, 0, paused=True)
    assert clock.wait_ns(6, 10**12) is None
    assert clock.wait_ns(5, 0) == 0


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e-7, 1e7, 5e-324, 1e308, float("nan"), float("inf")])
def test_a_rate_is_one_that_nanoseconds_can_be_counted_by(rate: float) -> None:
    clock = PlaybackClock(0, 0)
    with pytest.raises(ConfigurationError, match="must be from 1e-06 to 1e\\+06"):
        clock.set_rate(rate, 1)
    assert clock.rate == 1.0
    with pytest.raises(ConfigurationError, match="rate"):
        PlaybackClock(0, 0, rate=rate)


@pytest.mark.parametrize("rate", [1e-6, 1e6])
def test_at_the_slowest_and_the_fastest_rate_a_century_can_be_counted(rate: float) -> None:
    century_ns = 100 * 365 * 86400 * 10**9
    clock = PlaybackClock(0, 0, rate=rate)
    assert clock.wait_ns(century_ns, 0) == pytest.approx(century_ns / rate, rel=1e-9)
    assert clock.bag_ns(century_ns) == pytest.approx(century_ns * rate, rel=1e-9)
