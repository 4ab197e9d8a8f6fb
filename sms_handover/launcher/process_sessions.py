"""Process sessions: everything that launched processes have started, ended with them.

As a program, ``python -m sms_handover.launcher.process_sessions``, it is the guard of a launcher: it reads
sessions from standard input and, when that is closed, ends whatever still runs in them. A launcher that is
killed closes it too.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from time import monotonic, sleep

from sms_handover.process_status import ProcessStatus, running_in

GRACE_S = 20.0  # [s] of wall time that processes get to end when asked to, before they are killed

_POLL_PERIOD_S = 0.05  # [s] of wall time between two looks at what still runs


def end_sessions(sessions: Collection[int], grace_s: float) -> set[int]:
    """End every process of some sessions: ask it to, wake it if it is suspended, wait, kill what is left.

    A session has the id of the process that began it, which may have ended before. Returns the sessions
    in which something had to be killed.
    """
    for number in (signal.SIGTERM, signal.SIGCONT):
        _signal(running_in(sessions).values(), number)
    deadline = monotonic() + grace_s
    while (left := running_in(sessions)) and monotonic() < deadline:
        sleep(_POLL_PERIOD_S)
    _signal(left.values(), signal.SIGKILL)
    return {status.session for status in left.values()}


class SessionGuard:
    """A process that ends sessions for a launcher that can no longer do so."""

    def __init__(self, inherited: Sequence[int] = ()) -> None:
        """Start it; it keeps the ``inherited`` file descriptors open."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sms_handover.launcher.process_sessions"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            pass_fds=inherited,
            bufsize=0,
        )

    def add(self, session: int) -> None:
        """Let it end a session too."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it was killed
            self._process.stdin.write(b"%d\n" % session)

    def close(self) -> None:
        """Let it end what is left, and wait for it."""
        self._process.communicate()


def _signal(processes: Iterable[ProcessStatus], number: signal.Signals) -> None:
    for group in {status.group for status in processes}:
        with suppress(ProcessLookupError, PermissionError):  # it has ended, or is another user's
            os.killpg(group, number)


if __name__ == "__main__":
    end_sessions({int(line) for line in sys.stdin}, GRACE_S)
