"""What is said of real time before a run follows from what its wake-ups take."""

import pytest

from sms_handover.launcher.wake_ups import WakeUps, measure_wake_ups

TICK_S, REFERENCE_S = 0.001, 0.02


def machine(round_trip_s: float, late_s: float = 1e-5, slow: int = 0) -> WakeUps:
    """A machine whose wake-ups take so long, ``slow`` of 100 a whole 5 ms."""
    return WakeUps((late_s,) * 100, (5e-3,) * slow + (round_trip_s,) * (100 - slow))


def test_a_quick_machine_is_told_so() -> None:
    line = machine(1e-4).forecast(TICK_S, REFERENCE_S, composed=False)
    assert line.endswith("99 % of round trips take up to 0.10 ms here, which it bears")


@pytest.mark.parametrize(("slow", "held"), [(0, 0.0), (1, 0.01), (17, 0.17), (100, 1.0)])
def test_what_takes_longer_than_a_tick_holds_the_last_command(slow: int, held: float) -> None:
    assert machine(1e-4, slow=slow).missed(TICK_S, composed=False) == held


def test_both_threads_that_are_woken_count_and_so_does_the_work() -> None:
    assert machine(3.4e-4).missed(TICK_S, composed=False) == 0.0
    assert machine(3.6e-4).missed(TICK_S, composed=False) == 1.0
    assert (
        machine(3.6e-4).missed(TICK_S, composed=True) == 0.0
    )  # nothing is woken between plant and controller
    assert machine(3.6e-4, late_s=1.1e-3).missed(TICK_S, composed=True) == 1.0


def test_a_slow_machine_is_told_what_to_take_instead() -> None:
    line = machine(6e-4).forecast(TICK_S, REFERENCE_S, composed=False)
    assert "expect about 100 % of the commands too late" in line
    assert line.endswith("better: --compose or -p common.tick:=0.002 or lock step, without --real-time")
    line = machine(6e-4).forecast(TICK_S, 0.005, composed=False)
    assert "common.tick:=0.005" in line, "a tick must go into the reference period"
    line = machine(1.0, late_s=2e-2).forecast(TICK_S, REFERENCE_S, composed=True)
    assert line.endswith("better: lock step, without --real-time")


def test_wake_ups_are_measured_once_per_tick() -> None:
    found = measure_wake_ups(TICK_S, 0.02)
    assert len(found.late_s) == len(found.round_trip_s) == 20
    assert min(found.late_s) >= 0.0 and min(found.round_trip_s) > 0.0
