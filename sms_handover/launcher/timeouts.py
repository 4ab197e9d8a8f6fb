"""How long a launcher has waited, and for whom."""

import sys
from collections.abc import Callable, Mapping
from time import monotonic

from sms_handover.errors import GraphError

SUSPENDED_NOTICE_S = 5.0  # [s] of wall time that a node is suspended before that is told
SUSPENDED_PATIENCE_S = 20.0  # [s] of wall time that a node is suspended before the run is given up

_LONGEST_LOOK_S = 1.0  # [s] of wall time between two looks; what is longer, the launcher itself was suspended
_DELAY_S = 10.0  # [s] of wall time between two lines on what is waited for


class ActiveTime:
    """Wall time that counts only while this process looks.

    A launcher that was suspended, by Ctrl-Z or with the whole machine, has not waited in vain.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._seen = clock()
        self.seconds = 0.0

    def look(self) -> None:
        """Count the time since the last look."""
        now = self._clock()
        self.seconds += min(now - self._seen, _LONGEST_LOOK_S)
        self._seen = now


class SuspensionMonitor:
    """Notices nodes that are suspended, by SIGSTOP or a debugger: the run waits for them, not for ever."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._told: set[str] = set()

    def look(self, suspended: Mapping[str, int], seconds: float) -> None:
        """Take the process ids, by name, of those that are suspended at a watched time.

        Who is suspended for 5 s is told, with the way out; after 20 s GraphError is raised.
        """
        self._since = {name: self._since.get(name, seconds) for name in suspended}
        self._told &= set(suspended)
        for name, since in self._since.items():
            if seconds - since > SUSPENDED_PATIENCE_S:
                raise GraphError(
                    f"node {name!r} has been suspended for {SUSPENDED_PATIENCE_S:g} s (by SIGSTOP?)"
                )
            if seconds - since > SUSPENDED_NOTICE_S and name not in self._told:
                self._told.add(name)
                print(
                    f"\nnode {name!r} is suspended; the run is given up after {SUSPENDED_PATIENCE_S:g} s; "
                    f"'kill -CONT {suspended[name]}' lets it go on",
                    file=sys.stderr,
                )


class WaitNotice:
    """Tells what something that has not begun waits for: after a while, and again when the reason changes."""

    def __init__(self) -> None:
        self._told, self._next_s = "", _DELAY_S

    def note(self, seconds: float, reason: str) -> str:
        """Return a line for the user, "" for none; ``seconds`` is how long it has been waited for."""
        if seconds < self._next_s or reason == self._told:
            return ""
        self._told, self._next_s = reason, seconds + _DELAY_S
        return f"the run has not begun after {seconds:.0f} s: {reason}"
