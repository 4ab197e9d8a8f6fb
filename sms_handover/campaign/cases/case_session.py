"""Session of a process for cases: it and all that it has started, their memory, and their end."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from sms_handover.process_status import PROC, running_in

_MB = 1e6  # [byte]
_KIB = 1024  # [byte]
_END_S = 1.0  # [s] that the system takes at most to end what is killed
_LOOK_S = 0.002  # [s] between two looks at whether it has
_GUARD = 'read -r _; kill -s KILL -- "-$1"; rm -rf -- "$2"'  # a line never comes, only the end of the input


class CaseGuard:
    """A shell that ends a session and removes its folder once the process that made the guard has ended.

    That may be killed, and a process for cases may be in a library that keeps Python from seeing it.
    """

    def __init__(self, session: int, folder: Path) -> None:
        """Start it; raises OSError where that cannot be."""
        self._shell = subprocess.Popen(
            ("/bin/sh", "-c", _GUARD, "sh", str(session), str(folder)),
            stdin=subprocess.PIPE,  # nobody but this process has its other end
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def close(self) -> None:
        """End it without a deed."""
        self._shell.kill()
        self._shell.wait()
        if self._shell.stdin:
            self._shell.stdin.close()


def takes_more(pid: int, limit_mb: float) -> bool:
    """Whether a process and all that it has started take more memory than a limit in MB.

    Pages that forked processes share count once. False where the system does not tell.
    """
    tree = list(_tree(pid))
    if sum(map(_resident_mb, tree)) <= limit_mb:
        return False
    return len(tree) == 1 or sum(map(_share_mb, tree)) > limit_mb


def end_session(leader: "subprocess.Popen[bytes]") -> None:
    """End at once whatever runs in the session that a child began, whether or not the child still does."""
    if leader.poll() is not None and (PROC / str(leader.pid)).exists():
        return  # another process has its id by now, which it could not have while the session is there
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(leader.pid, signal.SIGKILL)
    latest = time.monotonic() + _END_S
    while PROC.is_dir() and (members := running_in({leader.pid})) and time.monotonic() < latest:
        for pid in members:  # of groups of their own, or begun meanwhile
            with suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(_LOOK_S)


def _tree(pid: int) -> Iterator[int]:
    """Yield a process and all that is below it."""
    yield pid
    with suppress(OSError):
        for task in os.listdir(PROC / f"{pid}/task"):
            with suppress(OSError):
                for child in (PROC / f"{pid}/task/{task}/children").read_text(encoding="ascii").split():
                    yield from _tree(int(child))


def _resident_mb(pid: int) -> float:
    """Return the resident memory of a process in MB, 0 where the system does not tell."""
    try:
        pages = int((PROC / f"{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / _MB


def _share_mb(pid: int) -> float:
    """Return the share of a process in memory in MB, of shared pages a part; all of it if that is unknown."""
    try:
        lines = (PROC / f"{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) * _KIB / _MB
    except (OSError, ValueError, StopIteration):
        return _resident_mb(pid)
