"""What Fast DDS leaves in shared memory when a process is killed, and its removal.

A participant makes a segment, ``fastrtps_<16 hexadecimal digits>``, and reads from ports,
``fastrtps_port<number>``, each with a mutex. It holds a lock (flock) on ``<name>_el`` for as long as it
lives and removes all of it at its end. Of a process that was killed they stay: a later process that needs
the same port clears it, but nobody ever removes the segment (0.5 MB each).

A run writes down, in a file beside them, the names that its processes hold locks on, each with the inodes
of lock and memory. What is in its list and no longer locked is of the dead, and is removed at the end of the
run; if the launcher was killed too, by the next run of this user. Nothing that is not in such a list is ever
touched.

The name of a segment is never used twice. That of a port is, by whoever needs one next, on any domain. Even
to try the lock of a port that another process is about to take makes Fast DDS believe that the port is not
free; then two nodes of that graph do not hear each other. So ports are looked at only where a segment tells
that somebody was killed, and only those that have the inodes of the list.
"""

import fcntl
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import NamedTuple, TextIO

FOLDER = Path("/dev/shm")  # of Linux; elsewhere there is nothing to do here

_LIST = "sms_handover_"
_LOCK = "_el"
_PORT = "fastrtps_port"
_NAME = re.compile(rf"fastrtps_[0-9a-f]{{16}}|{_PORT}[0-9]{{1,5}}")
_LINE = re.compile(rf"({_NAME.pattern}) ([0-9]{{1,20}}) ([0-9]{{1,20}})\n")


class _Inodes(NamedTuple):
    """What stands behind a name: the inodes of its lock and of its memory, 0 for what is not there."""

    lock: int
    memory: int

    @classmethod
    def of(cls, folder: Path, name: str) -> "_Inodes":
        """Return what is there now."""
        return cls(_inode(folder / f"{name}{_LOCK}"), _inode(folder / name))

    def stayed(self, now: "_Inodes") -> bool:
        """Whether what is there now is still the same: the lock or, without one, the memory."""
        return self.lock == now.lock if now.lock else self.memory == now.memory


class SharedMemory:
    """The list of one run; use it as a context manager around everything that takes part in it."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._folder = folder
        self._list: TextIO | None = None
        self._held: dict[str, _Inodes] = {}

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
            if not _remove_unlocked(self._folder, self._held):
                Path(self._list.name).unlink(missing_ok=True)
            self._list.close()

    def note(self, pids: Iterable[int]) -> None:
        """Write down what processes of this run hold locks on; look often while they start."""
        if self._list is None:
            return
        held = {name: inodes for pid in pids for name, inodes in _held_by(pid, self._folder)}
        if new := held.items() - self._held.items():
            self._held.update(new)
            self._list.write("".join(f"{name} {lock} {memory}\n" for name, (lock, memory) in sorted(new)))
            self._list.flush()


def _private(path: str, flags: int) -> int:
    """Open a file that only this user may read."""
    return os.open(path, flags, 0o600)


def _held_by(pid: int, folder: Path) -> Iterator[tuple[str, _Inodes]]:
    """Return the names that a process holds locks on, with the inodes; none if it is gone."""
    with suppress(OSError):
        for entry in os.scandir(f"/proc/{pid}/fd"):
            with suppress(OSError):
                target = Path(os.readlink(entry.path))
                name = target.name.removesuffix(_LOCK)
                if target.parent == folder and target.name.endswith(_LOCK) and _NAME.fullmatch(name):
                    yield name, _Inodes.of(folder, name)


def _clear_after(left: Path) -> None:
    """Remove what the run of a list has left, and the list, if that run is over and was this user's."""
    with suppress(OSError), left.open(encoding="ascii") as file:
        if os.fstat(file.fileno()).st_uid != os.geteuid():
            return
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        found = [match.groups() for line in file if (match := _LINE.fullmatch(line))]
        held = {name: _Inodes(int(lock), int(memory)) for name, lock, memory in found}
        if not _remove_unlocked(left.parent, held):
            left.unlink(missing_ok=True)


def _remove_unlocked(folder: Path, noted: Mapping[str, _Inodes]) -> list[str]:
    """Remove what nobody holds a lock on; return the names that somebody does."""
    held, killed = [], False
    for name, inodes in sorted(noted.items()):  # segments before ports
        port, now = name.startswith(_PORT), _Inodes.of(folder, name)
        if not any(now) or (port and not (killed and inodes.stayed(now))):
            continue
        memory, lock = folder / name, folder / f"{name}{_LOCK}"
        with suppress(OSError), lock.open("ab") as file:  # made if only the memory is left
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                held.append(name)
                continue
            killed = True
            for left in (memory, folder / f"sem.{name}_mutex", lock):
                left.unlink(missing_ok=True)
    return held


def _inode(file: Path) -> int:
    """Return the inode of a file, 0 if there is none."""
    try:
        return file.stat().st_ino
    except OSError:
        return 0
