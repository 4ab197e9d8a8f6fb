"""Timeouts of a launcher: for how long it has waited, for whom, and when it gives up."""

from collections.abc import Callable, Mapping
from time import monotonic

from sms_handover.errors import GraphError

SUSPENDED_NOTICE_S = 5.0  # [s] of wall time that a node is suspended before it is reported
SUSPENDED_TIMEOUT_S = 20.0  # [s] of wall time that a node is suspended before the run is given up

_LONGEST_STEP_S = 1.0  # [s] of wall time between two updates; for more, the launcher itself was suspended
_NOTICE_PERIOD_S = 10.0  # [s] of wall time between two notices


class ActiveTime:
    """Wall time that counts only while this process runs.

    A launcher that was suspended, by Ctrl-Z or with the whole machine, has not waited in vain.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._last = clock()
        self.seconds = 0.0

    def update(self) -> None:
        """Count the time since the last update."""
        now = self._clock()
        self.seconds += min(now - self._last, _LONGEST_STEP_S)
        self._last = now


class SuspensionMonitor:
    """Notices nodes that are suspended, by SIGSTOP or a debugger: the run waits for them, not for ever."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._reported: set[str] = set()

    def poll(self, suspended: Mapping[str, int], seconds: float) -> list[str]:
        """Return a line for each node that has been suspended for 5 s, once, with the way out.

        ``suspended`` are process ids by name, ``seconds`` is active time. Raises GraphError after 20 s.
        """
        self._since = {name: self._since.get(name, seconds) for name in suspended}
        self._reported &= set(suspended)
        lines = []
        for name, since in self._since.items():
            if seconds - since > SUSPENDED_TIMEOUT_S:
                raise GraphError(
                    f"node {name!r} has been suspended for {SUSPENDED_TIMEOUT_S:g} s (by SIGSTOP?)"
                )
            if seconds - since > SUSPENDED_NOTICE_S and name not in self._reported:
                self._reported.add(name)
                lines.append(
                    f"node {name!r} is suspended; the run is given up after {SUSPENDED_TIMEOUT_S:g} s; "
                    f"'kill -CONT {suspended[name]}' lets it go on"
                )
        return lines


class WaitNotice:
    """Reports why a run has not begun: after a while, and again when the reason changes."""

    def __init__(self) -> None:
        self._reason, self._next_s = "", _NOTICE_PERIOD_S

    def poll(self, seconds: float, reason: str) -> list[str]:
        """Return a line for the user if one is due; ``seconds`` is how long the run has been waited for."""
        if seconds < self._next_s or reason == self._reason:
            return []
        self._reason, self._next_s = reason, seconds + _NOTICE_PERIOD_S
        return [f"the run has not begun after {seconds:.0f} s: {reason}"]
