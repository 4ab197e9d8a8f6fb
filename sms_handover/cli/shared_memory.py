"""What Fast DDS leaves in shared memory when a process is killed, and its removal.

A participant makes a segment, ``fastrtps_<16 hexadecimal digits>``, and reads from ports,
``fastrtps_port<number>``, each with a mutex. It holds a lock (flock) on ``<name>_el`` for as long as it
lives and removes all of it at its end. Of a process that was killed they stay: a later process that needs
the same port clears it, but nobody ever removes the segment (0.5 MB each).

A run writes down, in a file beside them, the names that its processes hold locks on. What is in its list
and no longer locked is of the dead, and is removed at the end of the run; if the launcher was killed too,
by the next run of this user. Nothing that is not in such a list is ever touched.
"""

import fcntl
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import TextIO

FOLDER = Path("/dev/shm")  # of Linux; elsewhere there is nothing to do here

_LIST = "sms_handover_"
_LOCK = "_el"
_NAME = re.compile(r"fastrtps_([0-9a-f]{16}|port[0-9]{1,5})")


class SharedMemory:
    """The list of one run; use it as a context manager around everything that takes part in it."""

    def __init__(self, folder: Path = FOLDER) -> None:
        """Make nothing yet."""
        self._folder = folder
        self._list: TextIO | None = None
        self._names: set[str] = set()

    def __enter__(self) -> "SharedMemory":
        """Remove what dead runs have left, and begin a list."""
        if os.access(self._folder, os.W_OK):
            for left in sorted(self._folder.glob(f"{_LIST}*")):
                _clear_after(left)
            path = self._folder / f"{_LIST}{os.getpid()}_{token_hex(4)}"
            self._list = open(path, "x", encoding="ascii", opener=_private)
            fcntl.flock(self._list, fcntl.LOCK_EX)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove what is left of this run; the list stays while somebody still holds something of it."""
        if self._list is not None:
            if not _remove_unlocked(self._folder, self._names):
                Path(self._list.name).unlink(missing_ok=True)
            self._list.close()

    def note(self, pids: Iterable[int]) -> None:
        """Write down what processes of this run hold locks on; look often while they start."""
        if self._list is None:
            return
        held = {name for pid in pids for name in _held_by(pid, self._folder)}
        if new := held - self._names:
            self._names |= new
            self._list.write("".join(f"{name}\n" for name in sorted(new)))
            self._list.flush()


def _private(path: str, flags: int) -> int:
    """Open a file that only this user may read."""
    return os.open(path, flags, 0o600)


def _held_by(pid: int, folder: Path) -> Iterator[str]:
    """Return the names that a process holds locks on, none if it is gone."""
    with suppress(OSError):
        for entry in os.scandir(f"/proc/{pid}/fd"):
            with suppress(OSError):
                target = Path(os.readlink(entry.path))
                name = target.name.removesuffix(_LOCK)
                if target.parent == folder and target.name.endswith(_LOCK) and _NAME.fullmatch(name):
                    yield name


def _clear_after(left: Path) -> None:
    """Remove what the run of a list has left, and the list, if that run is over and was this user's."""
    with suppress(OSError), left.open(encoding="ascii") as file:
        if os.fstat(file.fileno()).st_uid != os.geteuid():
            return
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        names = {line.strip() for line in file}
        if not _remove_unlocked(left.parent, {name for name in names if _NAME.fullmatch(name)}):
            left.unlink(missing_ok=True)


def _remove_unlocked(folder: Path, names: Iterable[str]) -> list[str]:
    """Remove what nobody holds a lock on; return the names that somebody does."""
    held = []
    for name in sorted(names):
        lock, others = folder / f"{name}{_LOCK}", (folder / name, folder / f"sem.{name}_mutex")
        if not any(file.exists() for file in (lock, *others)):
            continue
        with suppress(OSError), lock.open("ab") as file:  # made if only the rest is left
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                held.append(name)
                continue
            for left in (*others, lock):
                left.unlink(missing_ok=True)
    return held
