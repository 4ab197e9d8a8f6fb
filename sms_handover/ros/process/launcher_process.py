"""The launcher of this process: a launcher of ours or ``ros2 run``, whose end is the end of its nodes."""

import ctypes
import os
import signal
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from sms_handover.process_status import PROC, process_status

# Environment variables that a launcher sets for its nodes, whatever runs between: its id and its start.
LAUNCHER_PID, LAUNCHER_START = "SMS_HANDOVER_LAUNCHER_PID", "SMS_HANDOVER_LAUNCHER_START"

_PR_SET_PDEATHSIG = 1  # of prctl(2)


class LauncherProcess(NamedTuple):
    """A process and its start, so that a later process with the same id is not taken for it."""

    pid: int
    start: int | None  # None if it had ended before anybody looked

    @classmethod
    def of(cls, pid: int) -> "LauncherProcess":
        """Return the process that has an id now."""
        status = process_status(pid)
        return cls(pid, status and status.start)

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        status = process_status(self.pid)
        return status is not None and status.start == self.start


def launcher_environment() -> dict[str, str]:
    """Return the environment variables by which nodes know this process as their launcher."""
    pid, start = LauncherProcess.of(os.getpid())
    return {LAUNCHER_PID: str(pid), LAUNCHER_START: str(start)}


def launcher_of_this_process(environment: Mapping[str, str] = os.environ) -> LauncherProcess | None:
    """Return the launcher that started this process, None if none did.

    A launcher names itself in the environment. ``ros2 run`` does not: it is known by its command line,
    where the system shows that. A node that a shell or a service manager has started outlives them, as
    ``nohup`` and daemons need it.
    """
    if LAUNCHER_PID in environment:
        pid = int(environment[LAUNCHER_PID])
        start = environment.get(LAUNCHER_START)
        return LauncherProcess.of(pid) if start is None else LauncherProcess(pid, int(start))
    parent = os.getppid()
    try:
        words = (PROC / f"{parent}/cmdline").read_text(encoding="utf-8", errors="replace").split("\0")
    except OSError:
        return None
    names = (os.path.basename(word) for word in words)
    return LauncherProcess.of(parent) if ("ros2", "run") in pairwise(names) else None


def wake_when_parent_ends() -> None:
    """Let this process go on if it is suspended when its parent ends; nobody else would wake it (Linux).

    SIGCONT does nothing to a process that runs.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "prctl"):
        libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGCONT), 0, 0, 0)
