"""Inputs come together by their stamps, whatever order they arrive in."""

from itertools import permutations

import numpy as np
import pytest

from sms_handover.errors import MessageError, Reason
from sms_handover.ros.transport.stamp_sync import StampOrder, StampSync

NAMES = ("a", "b", "c")


@pytest.mark.parametrize("order", list(permutations(NAMES)))
def test_inputs_are_taken_once_all_are_there(order: tuple[str, ...]) -> None:
    sync: StampSync[str] = StampSync()
    for name in order:
        assert sync.take(5, NAMES) is None
        sync.add(5, name, name.upper())
    assert sync.take(5, NAMES) == {"a": "A", "b": "B", "c": "C"}
    assert sync.take(5, NAMES) is None
    assert sync.dropped == 0


@pytest.mark.parametrize("seed", range(20))
def test_any_arrival_gives_the_same_inputs(seed: int) -> None:
    """Up to ten stamps on the way at once, in any order; each is taken in its turn."""
    stamps = range(10)
    arrivals = [(stamp, name) for stamp in stamps for name in NAMES]
    np.random.default_rng(seed).shuffle(arrivals)
    sync: StampSync[tuple[int, str]] = StampSync()
    taken = []
    due = 0
    for arrival in arrivals:
        stamp, name = int(arrival[0]), str(arrival[1])
        sync.add(stamp, name, (stamp, name))
        while (inputs := sync.take(due, NAMES)) is not None:
            taken.append(inputs)
            due += 1
    assert taken == [{name: (stamp, name) for name in NAMES} for stamp in stamps]
    assert sync.dropped == 0


def test_the_newest_of_two_equal_stamps_counts() -> None:
    sync: StampSync[int] = StampSync()
    sync.add(0, "a", 1)
    sync.add(0, "a", 2)
    assert sync.take(0, ("a",)) == {"a": 2}


def test_what_is_not_asked_for_does_not_hold_back() -> None:
    sync: StampSync[int] = StampSync()
    sync.add(1, "a", 1)
    sync.add(1, "d", 4)
    assert sync.take(1, ("a",)) == {"a": 1, "d": 4}


def test_old_stamps_are_refused_and_counted() -> None:
    sync: StampSync[int] = StampSync()
    sync.add(3, "a", 3)
    sync.add(4, "a", 4)
    assert sync.take(4, ("a",)) == {"a": 4}
    assert sync.take(3, ("a",)) is None  # older than what was taken
    with pytest.raises(MessageError, match="worked on") as duplicate:
        sync.add(4, "b", 4)
    with pytest.raises(MessageError, match="worked on") as old:
        sync.add(2, "a", 2)
    assert (duplicate.value.reason, old.value.reason) == (Reason.DUPLICATE, Reason.OLD)
    assert sync.dropped == 2
    assert sync.take(4, ("b",)) is None
    sync.add(5, "a", 5)
    assert sync.take(5, ("a",)) == {"a": 5}
    assert sync.dropped == 2


def test_an_input_that_never_comes_does_not_fill_the_memory() -> None:
    sync: StampSync[int] = StampSync()
    for stamp in range(1000):
        sync.add(stamp, "a", stamp)
    assert sync.dropped > 900
    sync.add(999, "b", -999)
    assert sync.take(999, ("a", "b")) == {"a": 999, "b": -999}


def test_time_zero_begins_a_run_only_after_another() -> None:
    sync: StampSync[int] = StampSync()
    assert not sync.restarts_run(0)
    sync.add(0, "a", 0)
    assert not sync.restarts_run(0)  # the other inputs of the first stamp
    sync.take(0, ("a",))
    assert not sync.restarts_run(0)  # the same once more
    sync.add(1, "a", 1)
    sync.take(1, ("a",))
    assert sync.restarts_run(0)
    assert not sync.restarts_run(1)


def test_as_many_stamps_wait_as_asked_for() -> None:
    sync: StampSync[int] = StampSync(3)
    for stamp in range(5):
        sync.add(stamp, "a", stamp)
    assert sync.oldest_ns == 2
    assert sync.dropped == 2


def test_what_is_missing_is_told_from_the_last() -> None:
    sync: StampSync[int] = StampSync()
    assert sync.oldest_ns is None
    assert sync.missing(3, ("a", "b")) == "b"
    sync.add(3, "b", 0)
    sync.add(5, "a", 0)
    assert sync.oldest_ns == 3
    assert sync.missing(3, ("a", "b")) == "a"
    sync.add(3, "a", 0)
    assert sync.missing(3, ("a", "b")) == ""


def test_a_run_that_restarts_run_takes_the_same_stamps_again() -> None:
    sync: StampSync[str] = StampSync()
    sync.add(0, "a", "old")
    sync.take(0, ("a",))
    sync.add(1, "a", "left over")
    sync.reset()
    assert sync.take(1, ("a",)) is None
    assert not sync.restarts_run(0)
    sync.add(0, "a", "new")
    assert sync.take(0, ("a",)) == {"a": "new"}
    assert sync.dropped == 0


def test_a_stamp_from_the_future_is_refused_and_leaves_nothing() -> None:
    """Sixty-four of them would otherwise push out what really is waited for."""
    sync: StampSync[int] = StampSync(ahead_ns=10)
    for stamp in (11, 1000, 10**18):
        with pytest.raises(MessageError) as caught:
            sync.add(stamp, "a", 0)
        assert caught.value.reason is Reason.FUTURE
    assert sync.oldest_ns is None
    sync.add(10, "a", 1)
    assert sync.take(10, ("a",)) == {"a": 1}
    sync.add(20, "a", 2)
    with pytest.raises(MessageError):
        sync.add(21, "a", 2)


def test_a_run_in_real_time_may_go_on_as_the_wall_clock_does(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [5_000]
    monkeypatch.setattr("sms_handover.ros.transport.stamp_sync.monotonic_ns", lambda: now[0])
    sync: StampSync[int] = StampSync(ahead_ns=10, paced=True)
    sync.add(3, "a", 0)
    sync.take(3, ("a",))
    now[0] += 100
    with pytest.raises(MessageError):
        sync.add(114, "a", 0)
    sync.add(113, "a", 0)


def test_an_input_used_as_it_comes_is_used_in_order_and_once() -> None:
    order = StampOrder(ahead_ns=0)
    order.accept(0, 0)
    order.accept(5, 7)
    for stamp, now, reason in ((5, 7, Reason.DUPLICATE), (4, 7, Reason.OLD), (8, 7, Reason.FUTURE)):
        with pytest.raises(MessageError) as caught:
            order.accept(stamp, now)
        assert caught.value.reason is reason
    order.accept(7, 7)  # nothing that was refused has moved the newest
    order.reset()
    order.accept(0, 0)
