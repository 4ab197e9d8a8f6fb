"""Seconds become integer nanoseconds without loss."""

from math import degrees

import pytest

from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds, seconds_to_ns


def test_every_millisecond_of_an_hour_is_exact() -> None:
    """A time written in decimals, which no float holds exactly, is a whole number of milliseconds."""
    for tick in range(0, 3_600_000, 7):
        assert seconds_to_ns(tick * 0.001) == tick * 1_000_000
        assert seconds_to_ns(tick / 1000.0) == tick * 1_000_000


@pytest.mark.parametrize("time_ns", [0, 1, 999_999_999, 60_000_000_000, 2**52])
def test_nanoseconds_survive_a_round_trip(time_ns: int) -> None:
    """A float holds 2^52 ns (52 days) to better than half a nanosecond, so no stamp is lost."""
    assert seconds_to_ns(ns_to_seconds(time_ns)) == time_ns


def test_time_is_rounded_to_the_nearest_nanosecond() -> None:
    """Rounding, not truncation, and the same before zero."""
    assert [seconds_to_ns(x) for x in (1.6e-9, 1.4e-9, -1.6e-9)] == [2, 1, -2]


def test_display_units() -> None:
    """An angle and a length in the units that people read."""
    assert degrees(1.0) == DEG_PER_RAD
    assert MM_PER_M * 0.001 == 1.0
