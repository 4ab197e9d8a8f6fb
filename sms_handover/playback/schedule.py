"""The schedule of a playback: which message is to be sent next, and when."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from sms_handover.bag.files import RawMessage
from sms_handover.bag.time_order import TimeSpan
from sms_handover.errors import ConfigurationError
from sms_handover.playback.clock import PlaybackClock
from sms_handover.units import ns_to_seconds

Read = Callable[[int], Iterator[RawMessage]]  # opens the messages from a bag time on, by time

_MOST_BYTES = 64 * 1024 * 1024  # [byte] of messages read ahead, whatever their number


@dataclass(frozen=True)
class PlaybackOptions:
    """How to begin and what to do at the end; ``read_ahead`` bounds the messages held in memory."""

    rate: float = 1.0
    paused: bool = False
    loop: bool = False
    read_ahead: int = 1000


class PlaybackSchedule:
    """Hands out every message of a recording once, in order, none before its time.

    Whoever sends asks for the message that is :meth:`due`, and says when it is :meth:`sent`; until
    then it stays due, so a reader that is behind delays messages and never loses one.
    """

    def __init__(self, read: Read, span: TimeSpan, options: PlaybackOptions, now_ns: int) -> None:
        """Begin at the start of a span that is finite."""
        self._read, self._options = read, options
        self._start_ns, self._end_ns = int(span.start_ns), int(span.end_ns)
        self.clock = PlaybackClock(self._start_ns, now_ns, rate=options.rate, paused=options.paused)
        if options.loop and self._start_ns == self._end_ns:
            raise ConfigurationError("what is to be played lasts 0 s, so it cannot be looped")
        self.sent_count = 0
        self.largest_lag_ns = 0  # of wall time
        self._played_ns = 0
        self._steps = 0
        self._queue: deque[RawMessage] = deque()
        self._queued_bytes = 0
        self._from_ns = self._last_ns = self._start_ns
        self._messages = read(self._start_ns)

    @property
    def finished(self) -> bool:
        """Whether every message has been sent and nothing is to be repeated."""
        return self._head() is None

    def start(self, now_ns: int) -> None:
        """Let time begin to run now."""
        self.clock = PlaybackClock(self._from_ns, now_ns, rate=self.clock.rate, paused=self.clock.paused)

    def position_ns(self, now_ns: int) -> int:
        """Return the bag time up to which everything has been sent."""
        head = self._head()
        clock_ns = min(self.clock.bag_ns(now_ns), self._end_ns)
        return clock_ns if head is None else max(self._from_ns, min(clock_ns, head.log_time_ns))

    def achieved_rate(self, now_ns: int) -> float:
        """Return bag time sent per wall time in which the clock ran, steps aside."""
        return self._played_ns / max(self.clock.ran_ns(now_ns), 1)

    def due(self, now_ns: int) -> RawMessage | None:
        """Return the next message if its time has come, or a step has been asked for."""
        head = self._head()
        if head is None or self._steps:
            return head
        return head if self.clock.wait_ns(head.log_time_ns, now_ns) == 0 and not self.clock.paused else None

    def sent(self, now_ns: int) -> None:
        """Take notice that the message which was due has been sent."""
        message = self._queue.popleft()
        time_ns = message.log_time_ns
        self._queued_bytes -= len(message.data)
        self.sent_count += 1
        if self._steps:
            self._steps -= 1
            self.clock.jump(max(self.clock.bag_ns(now_ns), time_ns), now_ns)
        elif time_ns >= self._from_ns:
            lag_ns = round((self.clock.bag_ns(now_ns) - time_ns) / self.clock.rate)
            self.largest_lag_ns = max(self.largest_lag_ns, lag_ns)
            self._played_ns += time_ns - self._last_ns
        self._last_ns = max(self._last_ns, time_ns)
        if self._options.loop and self._head() is None:
            self.clock.jump(self._start_ns, now_ns)
            self._begin(self._start_ns)

    def wait_ns(self, now_ns: int) -> int | None:
        """Return the wall time until the next message is due, None while there is nothing to wait for."""
        head = self._head()
        if head is None or (self.clock.paused and self._steps == 0):
            return None
        return 0 if self._steps else self.clock.wait_ns(head.log_time_ns, now_ns)

    def read_ahead(self, at_most: int) -> None:
        """Read some messages that are not due yet, as far as the queue may grow."""
        for _ in range(min(at_most, self._options.read_ahead - len(self._queue))):
            message = next(self._messages, None) if self._queued_bytes < _MOST_BYTES else None
            if message is None:
                return
            self._queue.append(message)
            self._queued_bytes += len(message.data)

    def pause(self, now_ns: int) -> None:
        """Stand still at what has been sent."""
        if not self.clock.paused:
            self.clock.jump(self.position_ns(now_ns), now_ns)
            self.clock.pause(now_ns)

    def resume(self, now_ns: int) -> None:
        """Go on."""
        self._steps = 0
        self.clock.resume(now_ns)

    def toggle(self, now_ns: int) -> None:
        """Pause, or go on."""
        (self.resume if self.clock.paused else self.pause)(now_ns)

    def step(self, count: int = 1) -> bool:
        """Have the next messages sent at once; tells whether it can: only a paused playback steps."""
        possible = self.clock.paused and self._head() is not None
        if possible:
            self._steps += count
        return possible

    def set_rate(self, rate: float, now_ns: int) -> None:
        """Go on at another rate from what has been sent; raises ConfigurationError on a bad rate."""
        position_ns = self.position_ns(now_ns)
        self.clock.set_rate(rate, now_ns)
        self.clock.jump(position_ns, now_ns)

    def seek(self, bag_ns: int, now_ns: int) -> None:
        """Go on from another bag time; raises ConfigurationError if it is not in the recording."""
        if not self._start_ns <= bag_ns <= self._end_ns:
            raise ConfigurationError(
                f"cannot seek to {ns_to_seconds(bag_ns):.9g} s, allowed is from "
                f"{ns_to_seconds(self._start_ns):.9g} to {ns_to_seconds(self._end_ns):.9g} s of bag time"
            )
        self.clock.jump(bag_ns, now_ns)
        self._begin(bag_ns)

    def _begin(self, bag_ns: int) -> None:
        """Read from a bag time on."""
        self._from_ns = self._last_ns = bag_ns
        self._steps = 0
        self._queue.clear()
        self._queued_bytes = 0
        self._messages = self._read(bag_ns)

    def _head(self) -> RawMessage | None:
        """Return the next message without taking it, None at the end."""
        if not self._queue:
            self.read_ahead(1)
        return self._queue[0] if self._queue else None
