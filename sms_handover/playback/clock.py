"""Playback clock: bag time as a function of wall time."""

from sms_handover.errors import ConfigurationError

_SLOWEST, _FASTEST = 1e-6, 1e6  # [-] beyond them nanoseconds of wall time do not suffice


class PlaybackClock:
    """Bag time that runs at a rate and can be paused and set.

    It reads no clock: every method takes the wall time ``now_ns``, any monotonic count of ns.
    """

    def __init__(self, bag_ns: int, now_ns: int, *, rate: float = 1.0, paused: bool = False) -> None:
        """Start at a bag time; raises ConfigurationError if the rate is out of range."""
        self._rate = _checked(rate)
        self._paused = paused
        self._bag_ns, self._at_ns = bag_ns, now_ns  # bag time at a wall time
        self._ran_ns = 0

    @property
    def rate(self) -> float:
        """Return seconds of the bag per second of wall time."""
        return self._rate

    @property
    def paused(self) -> bool:
        """Whether bag time is paused."""
        return self._paused

    def bag_ns(self, now_ns: int) -> int:
        """Return the bag time."""
        if self._paused:
            return self._bag_ns
        return self._bag_ns + round((now_ns - self._at_ns) * self._rate)

    def wait_ns(self, bag_ns: int, now_ns: int) -> int | None:
        """Return the wall time until a bag time, 0 if it has passed, None while paused."""
        left_ns = bag_ns - self.bag_ns(now_ns)
        if left_ns <= 0:
            return 0
        return None if self._paused else max(1, round(left_ns / self._rate))

    def ran_ns(self, now_ns: int) -> int:
        """Return the wall time for which the clock has run."""
        return self._ran_ns + (0 if self._paused else now_ns - self._at_ns)

    def pause(self, now_ns: int) -> None:
        """Pause."""
        self.jump(self.bag_ns(now_ns), now_ns)
        self._paused = True

    def resume(self, now_ns: int) -> None:
        """Resume."""
        self.jump(self.bag_ns(now_ns), now_ns)
        self._paused = False

    def set_rate(self, rate: float, now_ns: int) -> None:
        """Change the rate from now on; raises ConfigurationError if it is out of range."""
        checked = _checked(rate)
        self.jump(self.bag_ns(now_ns), now_ns)
        self._rate = checked

    def jump(self, bag_ns: int, now_ns: int) -> None:
        """Set the bag time."""
        self._ran_ns = self.ran_ns(now_ns)
        self._bag_ns, self._at_ns = bag_ns, now_ns


def _checked(rate: float) -> float:
    """Return the rate if it is in range."""
    if not _SLOWEST <= rate <= _FASTEST:
        raise ConfigurationError(f"rate is {rate:g}, must be from {_SLOWEST:g} to {_FASTEST:g}")
    return rate
