"""The process that started this one: a launcher, whose end is the end of its nodes, or anything else.

As a program, ``python -m sms_handover.ros.process.launcher_process COMMAND ...``, it becomes a command
that is ended with its launcher: for nodes of others, which do not look for it themselves.
"""

import ctypes
import os
import signal
import sys
from itertools import pairwise
from pathlib import Path

LAUNCHER_PID = "SMS_HANDOVER_LAUNCHER_PID"  # environment variable, set for the nodes that a launcher starts

_PR_SET_PDEATHSIG = 1  # of prctl(2)


def launcher_of_this_process() -> int:
    """Return the process id of the launcher that started this process, 0 if none did.

    A launcher names itself in the environment. ``ros2 run`` does not: it is known by its command line,
    where the system shows that. A node that a shell or a service manager has started outlives them, as
    ``nohup`` and daemons need it.
    """
    named = os.environ.get(LAUNCHER_PID)
    if named is not None:
        return int(named)
    parent = os.getppid()
    try:
        words = Path(f"/proc/{parent}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return 0
    names = [Path(word).name for word in words]
    is_ros2_run = any(pair == ("ros2", "run") for pair in pairwise(names))
    return parent if is_ros2_run else 0


def wake_when_parent_ends() -> None:
    """Let this process go on if it is suspended when its parent ends; nobody else would wake it (Linux).

    SIGCONT does nothing to a process that runs. It comes too late only for a parent that has ended
    already, which the parent's process id tells.
    """
    _signal_when_parent_ends(signal.SIGCONT)


def _signal_when_parent_ends(number: signal.Signals) -> None:
    """Let the system send a signal to this process, and what it becomes, when its parent ends (Linux)."""
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "prctl"):
        libc.prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)


if __name__ == "__main__":
    _signal_when_parent_ends(signal.SIGTERM)
    if os.getppid() == launcher_of_this_process():
        os.execvp(sys.argv[1], sys.argv[1:])
