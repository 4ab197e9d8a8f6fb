"""The watch on the launcher: tells a node that it has ended, and ends a node that no longer reacts."""

import faulthandler
import os
import time
from contextlib import suppress
from select import select
from threading import Thread

from sms_handover.ros.process.launcher_process import LauncherProcess

_GRACE_S = 90.0  # [s] of wall time for a node to end in order; a recorder may still have much to write
_POLL_PERIOD_S = 1.0  # [s] of wall time between two looks, where the system does not report the end
_STANDARD_ERROR = 2  # file descriptor, whatever stands in for the stream


class LauncherWatch:
    """Waits in its own thread for the end of the launcher, be it the parent of this process or further up.

    Then ``launcher_has_ended``, and a node that has not ended 90 s later writes to its log where it
    hangs, and exits with 1. That is done by a thread of faulthandler's, which needs neither the
    interpreter nor any lock: not even a call into the middleware that never returns keeps a node alive.
    """

    def __init__(self, launcher: LauncherProcess) -> None:
        self._launcher = launcher
        self.launcher_has_ended = False
        if launcher.running:
            Thread(target=self._watch, name="launcher_watch", daemon=True).start()
        else:
            self._on_end()

    def _watch(self) -> None:
        if hasattr(os, "pidfd_open"):
            with suppress(OSError):
                handle = os.pidfd_open(self._launcher.pid)
                if self._launcher.running:  # else the handle may be that of a later process
                    select([handle], [], [])
                os.close(handle)
        while self._launcher.running:
            time.sleep(_POLL_PERIOD_S)
        self._on_end()

    def _on_end(self) -> None:
        """Set the time limit, and let the node know."""
        faulthandler.dump_traceback_later(_GRACE_S, exit=True, file=_STANDARD_ERROR)
        self.launcher_has_ended = True
