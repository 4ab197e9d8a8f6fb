"""What an attempt has left behind: processes and shared memory."""

import os
import signal
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from time import monotonic

from ..system.runs import has_ended

MARK = "SMS_HANDOVER_FAULT"  # environment variable that every process of a trial inherits
GRACE_S = 20.0  # [s] of wall time for the nodes to notice that their launcher is gone, on a busy machine
SHARED_MEMORY = Path("/dev/shm")

_KILLED_S = 20.0  # [s] of wall time at most in which the system takes away what was killed
_LONGEST = 100  # characters of a command line


def of_trial(mark: str, *, without: int = 0) -> dict[int, str]:
    """Return the processes that carry a mark or belong to a session of one that does, by id.

    One that has ended and only waits to be reaped is none.
    """
    wanted = f"{MARK}={mark}".encode()
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal()]
    marked = {pid for pid in pids if wanted in _environment(pid)}
    sessions = {_session(pid) for pid in marked} - {_session(os.getpid()), 0}
    found = {pid for pid in pids if pid in marked or _session(pid) in sessions}
    return {pid: text for pid in sorted(found - {without}) if (text := _command_line(pid))}


def wait_for_none(mark: str) -> dict[int, str]:
    """Wait for the end of every process of a trial; return those that are still there."""
    deadline = monotonic() + GRACE_S
    while found := of_trial(mark, without=os.getpid()):
        if not all(has_ended(pid, max(deadline - monotonic(), 0.0)) for pid in found):
            return of_trial(mark, without=os.getpid())
    return {}


def end_all(pids: Iterable[int]) -> None:
    """Kill processes and wait for their end."""
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    for pid in pids:
        has_ended(pid, _KILLED_S)


def shared_memory() -> int:
    """Return the bytes in /dev/shm."""
    sizes = []
    for file in SHARED_MEMORY.iterdir():
        with suppress(OSError):
            sizes.append(file.stat().st_blocks * 512)  # [byte] st_blocks counts so, whatever the system
    return sum(sizes)


def _environment(pid: int) -> list[bytes]:
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []


def _session(pid: int) -> int:
    try:
        return os.getsid(pid)
    except OSError:
        return 0


def _command_line(pid: int) -> str:
    """Return the command line, '' of a process that has ended."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return b" ".join(words).decode(errors="replace").strip()[:_LONGEST]
