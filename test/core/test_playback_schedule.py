"""Every message once, in order, none before its time: whatever is pressed, and however slow the sending."""

from collections.abc import Callable, Iterator
from random import Random

import pytest

from sms_handover.bag.files import RawMessage
from sms_handover.bag.time_order import TimeSpan
from sms_handover.errors import ConfigurationError
from sms_handover.playback.report import closing_line, progress_line
from sms_handover.playback.schedule import PlaybackOptions, PlaybackSchedule

S = 1_000_000_000  # ns
MS = 1_000_000  # ns


def message(time_ns: int) -> RawMessage:
    return RawMessage("/topic", "a/msg/B", str(time_ns).encode(), time_ns, 0)


class Bag:
    """Messages at known times, which notes how far it has been read."""

    def __init__(self, times: list[int]) -> None:
        """Take the times."""
        self.times = times
        self.read = 0
        self.opened: list[int] = []

    def open(self, from_ns: int) -> Iterator[RawMessage]:
        """Yield the messages from a time on."""
        self.opened.append(from_ns)
        for time_ns in self.times:
            if time_ns >= from_ns:
                self.read += 1
                yield message(time_ns)


class Play:
    """A schedule driven by a clock that only this test moves."""

    def __init__(self, times: list[int], *, end_ns: int | None = None, **options: object) -> None:
        """Begin at wall time zero, which is the time of the first message."""
        self.bag = Bag(times)
        self.now = 0
        span = TimeSpan(times[0], times[-1] if end_ns is None else end_ns)
        self.schedule = PlaybackSchedule(self.bag.open, span, PlaybackOptions(**options), 0)  # type: ignore[arg-type]
        self.sent: list[tuple[int, int]] = []  # wall time, log time

    def send(self, cost_ns: int = 0) -> None:
        """Send everything that is due; each message takes a while."""
        while (due := self.schedule.due(self.now)) is not None:
            self.now += cost_ns
            self.sent.append((self.now, due.log_time_ns))
            self.schedule.sent(self.now)

    def run(self, until_ns: int, cost_ns: int = 0) -> None:
        """Let time pass from one message to the next."""
        while self.now <= until_ns:
            self.send(cost_ns)
            wait = self.schedule.wait_ns(self.now)
            if wait is None or self.now + wait > until_ns:
                break
            self.now += max(wait, 1)
        self.now = max(self.now, until_ns)

    @property
    def times(self) -> list[int]:
        """Return the log times sent."""
        return [time for _, time in self.sent]


TIMES = [10 * S + n * 100 * MS for n in range(51)]  # 5 s


@pytest.mark.parametrize("rate", [0.5, 1.0, 4.0])
def test_each_message_goes_out_when_its_time_comes(rate: float) -> None:
    play = Play(TIMES, rate=rate)
    play.run(60 * S)
    assert play.times == TIMES
    for wall, log in play.sent:
        assert wall == pytest.approx((log - TIMES[0]) / rate, abs=5)
    assert play.schedule.finished
    assert play.schedule.due(play.now) is None
    assert play.schedule.wait_ns(play.now) is None
    assert play.schedule.sent_count == len(TIMES)


def test_a_message_that_could_not_be_sent_stays_due() -> None:
    play = Play(TIMES)
    first = play.schedule.due(0)
    assert first is not None
    assert play.schedule.due(20 * S) == first
    assert play.schedule.sent_count == 0
    assert play.schedule.position_ns(20 * S) == first.log_time_ns


def test_slow_sending_makes_late_and_loses_nothing() -> None:
    play = Play(TIMES)
    play.run(60 * S, cost_ns=300 * MS)
    assert play.times == TIMES
    assert play.schedule.largest_lag_ns == 51 * 300 * MS - 5 * S
    assert play.schedule.achieved_rate(play.sent[-1][0]) == pytest.approx(5 / (51 * 0.3))
    line = closing_line(play.schedule, play.sent[-1][0])
    assert line == (
        "51 messages sent in 15.30 s, up to 10.30 s late: achieved rate 0.33 of 1; none was dropped"
    )


def test_in_time_the_report_says_how_well() -> None:
    play = Play(TIMES)
    play.run(60 * S, cost_ns=2 * MS)
    assert closing_line(play.schedule, 5 * S) == "51 messages sent in 5.00 s, none later than 2 ms"


def test_pause_holds_everything_and_nothing_is_made_up_for() -> None:
    play = Play(TIMES)
    play.run(1 * S)
    sent = len(play.sent)
    play.schedule.pause(play.now)
    play.run(100 * S)
    assert len(play.sent) == sent
    assert play.schedule.position_ns(play.now) == TIMES[0] + 1 * S
    play.schedule.toggle(play.now)
    play.run(200 * S)
    assert play.times == TIMES
    gaps = [
        later[0] - earlier[0] for earlier, later in zip(play.sent[sent:], play.sent[sent + 1 :], strict=False)
    ]
    assert gaps == pytest.approx([100 * MS] * len(gaps), abs=2)
    assert play.sent[-1][0] == pytest.approx(99 * S + 5 * S, abs=200)


def test_a_pause_while_late_does_not_let_the_late_ones_burst_out() -> None:
    play = Play(TIMES)
    play.send()
    play.now = 3 * S  # nothing could be sent meanwhile
    play.schedule.pause(play.now)
    play.schedule.resume(play.now)
    play.send()
    assert play.times == TIMES[:2]


def test_a_new_rate_while_late_makes_up_for_nothing() -> None:
    play = Play(TIMES)
    play.send()
    play.now = 3 * S  # nothing could be sent meanwhile
    play.schedule.set_rate(2.0, play.now)
    play.send()
    assert play.times == TIMES[:2]
    play.run(60 * S)
    assert play.sent[-1][0] == pytest.approx(3 * S + 4.9 * S / 2, abs=100)


def test_steps_send_one_by_one_and_only_while_paused() -> None:
    play = Play(TIMES, paused=True)
    play.run(10 * S)
    assert play.sent == []
    assert play.schedule.step()
    play.send()
    assert play.times == TIMES[:1]
    assert play.schedule.step(3)
    play.send()
    assert play.times == TIMES[:4]
    assert play.schedule.position_ns(play.now) == TIMES[3]
    play.schedule.resume(play.now)
    begin = play.now
    play.run(begin + 100 * MS)
    assert play.times == TIMES[:5]
    assert not play.schedule.step()


def test_steps_reach_the_end() -> None:
    play = Play(TIMES[:3], paused=True)
    assert play.schedule.step(10)
    play.send()
    assert play.times == TIMES[:3]
    assert play.schedule.finished
    assert not play.schedule.step()


def test_a_new_rate_holds_from_what_has_been_sent() -> None:
    play = Play(TIMES)
    play.run(1 * S)
    play.schedule.set_rate(10.0, play.now)
    play.run(60 * S)
    assert play.times == TIMES
    assert play.sent[-1][0] == pytest.approx(1 * S + 4 * S / 10, abs=100)
    with pytest.raises(ConfigurationError):
        play.schedule.set_rate(0.0, play.now)


def test_seek_goes_on_from_there_forwards_and_back() -> None:
    play = Play(TIMES)
    play.run(1 * S)
    play.sent.clear()
    play.schedule.seek(TIMES[40], play.now)
    play.send()
    assert play.times == TIMES[40:41]
    play.schedule.seek(TIMES[0], play.now)
    play.run(60 * S)
    assert play.times == [TIMES[40], *TIMES]
    for wrong in (TIMES[0] - 1, TIMES[-1] + 1):
        with pytest.raises(ConfigurationError, match="must be from 10 to 15 s"):
            play.schedule.seek(wrong, play.now)


def test_a_loop_begins_again_without_a_gap_in_rate() -> None:
    play = Play(TIMES, loop=True)
    play.run(16 * S)
    assert play.times[: 3 * len(TIMES)] == 3 * TIMES
    assert not play.schedule.finished
    assert [wall for wall, log in play.sent if log == TIMES[0]] == pytest.approx(
        [0, 5 * S, 10 * S, 15 * S], abs=300
    )


def test_a_single_instant_is_not_looped() -> None:
    with pytest.raises(ConfigurationError, match="span 0 s"):
        Play([S, S], loop=True)


def test_memory_is_bounded() -> None:
    play = Play([n * MS for n in range(10_000)], read_ahead=100)
    for _ in range(10):
        play.schedule.read_ahead(1000)
    assert play.bag.read == 100
    play.run(1 * S)
    play.schedule.read_ahead(1000)
    assert play.bag.read <= 1001 + 100


def test_memory_is_bounded_for_large_messages_too() -> None:
    """Ten images of 32 MiB: two are enough to wait with; the queue counts down as they go."""
    size, read = 32 * 1024 * 1024, []

    def images(from_ns: int) -> Iterator[RawMessage]:
        for number in range(10):
            read.append(number)
            yield RawMessage("/image", "a/msg/Image", bytes(size), number * S, 0)

    schedule = PlaybackSchedule(images, TimeSpan(0, 9 * S), PlaybackOptions(), 0)
    schedule.read_ahead(1000)
    assert len(read) == 2
    for number in range(10):
        assert schedule.due(number * S) is not None
        schedule.sent(number * S)
        schedule.read_ahead(1000)
        assert len(read) <= number + 3
    assert schedule.finished


def test_messages_before_the_beginning_are_due_at_once_and_do_not_count_as_late() -> None:
    """Latched messages in force at the beginning have an older time."""
    times = [1 * S, 2 * S, *TIMES]
    schedule = PlaybackSchedule(
        lambda from_ns: iter([message(time) for time in times]),
        TimeSpan(TIMES[0], TIMES[-1]),
        PlaybackOptions(),
        0,
    )
    sent = []
    while (due := schedule.due(1)) is not None:
        sent.append(due.log_time_ns)
        schedule.sent(1)
    assert sent == times[:3]
    assert schedule.largest_lag_ns <= 1
    assert schedule.position_ns(1) == TIMES[0] + 1


def test_start_begins_to_count_then() -> None:
    play = Play(TIMES)
    play.schedule.start(100 * S)
    play.now = 100 * S
    play.run(200 * S)
    assert play.schedule.largest_lag_ns == 0
    assert play.sent[-1][0] == pytest.approx(105 * S, abs=100)


def test_nothing_to_play_is_finished_at_once() -> None:
    schedule = PlaybackSchedule(lambda from_ns: iter(()), TimeSpan(0, 5), PlaybackOptions(loop=True), 0)
    assert schedule.finished and schedule.due(10) is None
    assert not schedule.step()


def test_progress_is_in_words() -> None:
    play = Play(TIMES, rate=2.0)
    play.run(1 * S)
    assert progress_line(play.schedule, TimeSpan(TIMES[0], TIMES[-1]), play.now) == (
        "    2.00 of 5 s  rate 2.00, achieved 2.00  21 messages"
    )
    play.schedule.pause(play.now)
    assert "rate 2.00, paused" in progress_line(play.schedule, TimeSpan(TIMES[0], TIMES[-1]), play.now)


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_pressed_nothing_is_lost_or_doubled(seed: int) -> None:
    """Random pauses, steps, rates and delays; position and order never go back."""
    random = Random(seed)
    play = Play(TIMES)
    acts: list[Callable[[], object]] = [
        lambda: play.schedule.toggle(play.now),
        lambda: play.schedule.step(random.randrange(1, 4)),
        lambda: play.schedule.set_rate(random.choice((0.2, 1.0, 5.0)), play.now),
        lambda: play.schedule.read_ahead(random.randrange(20)),
        lambda: None,
    ]
    position = 0
    for _ in range(300):
        random.choice(acts)()
        play.now += random.randrange(200 * MS)
        play.send(cost_ns=random.choice((0, 0, 30 * MS)))
        assert play.schedule.position_ns(play.now) >= position
        position = play.schedule.position_ns(play.now)
    play.schedule.resume(play.now)
    play.run(play.now + 60 * S)
    assert play.times == TIMES
