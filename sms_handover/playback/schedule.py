"""Playback schedule: which message to send next, and when."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from sms_handover.bag.files import RawMessage
from sms_handover.bag.time_order import TimeSpan
from sms_handover.errors import ConfigurationError
from sms_handover.playback.clock import PlaybackClock
from sms_handover.units import ns_to_seconds

Read = Callable[[int], Iterator[RawMessage]]  # the messages from a bag time on, in time order

_MOST_BYTES = 64 * 1024 * 1024  # [byte] of messages read ahead at most


@dataclass(frozen=True)
class PlaybackOptions:
    """How to start and end; ``read_ahead`` bounds the messages held in memory."""

    rate: float = 1.0
    paused: bool = False
    loop: bool = False
    read_ahead: int = 1000


class PlaybackSchedule:
    """Hands out every message of a recording once, in order, none before its time.

    The sender asks for the message that is :meth:`due` and reports it :meth:`sent`; until then it stays
    due, so a slow subscriber delays messages and never loses one.
    """

    def __init__(self, read: Read, span: TimeSpan, options: PlaybackOptions, now_ns: int) -> None:
        """Start at the beginning of a finite span; raises ConfigurationError on a loop over 0 s."""
        self._read, self._options = read, options
        self._start_ns, self._end_ns = int(span.start_ns), int(span.end_ns)
        self.clock = PlaybackClock(self._start_ns, now_ns, rate=options.rate, paused=options.paused)
        if options.loop and self._start_ns == self._end_ns:
            raise ConfigurationError("the messages to play span 0 s and cannot be looped")
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
        """Whether every message has been sent."""
        return self._head() is None

    def start(self, now_ns: int) -> None:
        """Start the clock now."""
        self.clock = PlaybackClock(self._from_ns, now_ns, rate=self.clock.rate, paused=self.clock.paused)

    def position_ns(self, now_ns: int) -> int:
        """Return the bag time up to which everything has been sent."""
        head = self._head()
        clock_ns = min(self.clock.bag_ns(now_ns), self._end_ns)
        return clock_ns if head is None else max(self._from_ns, min(clock_ns, head.log_time_ns))

    def achieved_rate(self, now_ns: int) -> float:
        """Return bag time sent per wall time, without pauses and steps."""
        return self._played_ns / max(self.clock.ran_ns(now_ns), 1)

    def due(self, now_ns: int) -> RawMessage | None:
        """Return the next message if it is due, or a step was requested."""
        head = self._head()
        if head is None or self._steps:
            return head
        return head if self.clock.wait_ns(head.log_time_ns, now_ns) == 0 and not self.clock.paused else None

    def sent(self, now_ns: int) -> None:
        """Advance past the message that was due."""
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
        """Return the wall time until the next message is due, None if none will be."""
        head = self._head()
        if head is None or (self.clock.paused and self._steps == 0):
            return None
        return 0 if self._steps else self.clock.wait_ns(head.log_time_ns, now_ns)

    def read_ahead(self, at_most: int) -> None:
        """Fill the queue by some messages, within its bounds."""
        for _ in range(min(at_most, self._options.read_ahead - len(self._queue))):
            message = next(self._messages, None) if self._queued_bytes < _MOST_BYTES else None
            if message is None:
                return
            self._queue.append(message)
            self._queued_bytes += len(message.data)

    def pause(self, now_ns: int) -> None:
        """Pause at the latest message sent."""
        if not self.clock.paused:
            self.clock.jump(self.position_ns(now_ns), now_ns)
            self.clock.pause(now_ns)

    def resume(self, now_ns: int) -> None:
        """Resume."""
        self._steps = 0
        self.clock.resume(now_ns)

    def toggle(self, now_ns: int) -> None:
        """Pause or resume."""
        (self.resume if self.clock.paused else self.pause)(now_ns)

    def step(self, count: int = 1) -> bool:
        """Make the next messages due at once; return False unless paused and before the end."""
        possible = self.clock.paused and self._head() is not None
        if possible:
            self._steps += count
        return possible

    def set_rate(self, rate: float, now_ns: int) -> None:
        """Continue at another rate; raises ConfigurationError if it is out of range."""
        position_ns = self.position_ns(now_ns)
        self.clock.set_rate(rate, now_ns)
        self.clock.jump(position_ns, now_ns)

    def seek(self, bag_ns: int, now_ns: int) -> None:
        """Continue from another bag time; raises ConfigurationError outside the recording."""
        if not self._start_ns <= bag_ns <= self._end_ns:
            raise ConfigurationError(
                f"cannot seek to {ns_to_seconds(bag_ns):.9g} s, must be from "
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
        """Return the next message, None at the end."""
        if not self._queue:
            self.read_ahead(1)
        return self._queue[0] if self._queue else None
