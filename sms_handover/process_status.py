"""Process status: the session and group of a process, and when it started, as the system tells them."""

import os
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

PROC = Path("/proc")  # of Linux


class ProcessStatus(NamedTuple):
    """Session and group of a process, and its start, which tells it from a later one with the same id."""

    session: int
    group: int
    start: int  # [clock ticks] since the system started, 0 where that is not known


def process_status(pid: int) -> ProcessStatus | None:
    """Return the status of a process, None if it has ended, whether or not it has been reaped."""
    try:
        if not PROC.is_dir():
            return ProcessStatus(os.getsid(pid), os.getpgid(pid), 0)
        # the name of the program stands in parentheses and may contain any character
        state, _, group, session, *rest = (PROC / f"{pid}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return None
    return None if state in b"ZX" else ProcessStatus(int(session), int(group), int(rest[15]))


def running_in(sessions: Collection[int]) -> dict[int, ProcessStatus]:
    """Return what runs in some sessions by its id; where the system has no list, what began them alone."""
    pids = [int(name) for name in os.listdir(PROC) if name.isdecimal()] if PROC.is_dir() else sessions
    return {pid: status for pid in pids if (status := process_status(pid)) and status.session in sessions}
