"""A watch on the launcher: tells a node that it is gone, and ends a node that can no longer listen."""

import faulthandler
import os
import time
from contextlib import suppress
from select import select
from threading import Thread

_PATIENCE_S = 90.0  # [s] of wall time for a node to end in order; a recorder may have much to write still
_LOOK_PERIOD_S = 1.0  # [s] of wall time between two looks, where the system does not tell of an end
_STANDARD_ERROR = 2  # file descriptor, whatever stands in for the stream


class LauncherWatch:
    """Waits in a thread of its own for the end of the process that has started this one.

    Then ``launcher_has_ended``, and a node that has not ended 90 s later writes to its log where it
    hangs, and exits with 1. That is done by a thread of faulthandler's, which needs neither the
    interpreter nor any lock: not even a call into the middleware that never returns keeps a node alive.
    """

    def __init__(self, launcher: int) -> None:
        """Begin to watch a process, by its id."""
        self._launcher = launcher
        self.launcher_has_ended = False
        if os.getppid() != launcher:
            self._notice()
        else:
            Thread(target=self._watch, name="launcher_watch", daemon=True).start()

    def _watch(self) -> None:
        """Wait for the end."""
        if hasattr(os, "pidfd_open"):
            with suppress(OSError):
                handle = os.pidfd_open(self._launcher)
                if os.getppid() == self._launcher:
                    select([handle], [], [])
                os.close(handle)
        while os.getppid() == self._launcher:
            time.sleep(_LOOK_PERIOD_S)
        self._notice()

    def _notice(self) -> None:
        """Set the time limit, and let the node know."""
        faulthandler.dump_traceback_later(_PATIENCE_S, exit=True, file=_STANDARD_ERROR)
        self.launcher_has_ended = True
