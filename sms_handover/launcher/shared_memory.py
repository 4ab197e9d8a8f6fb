"""Shared memory: the segments that Fast DDS leaves behind when a process is killed, and their removal.

A participant creates a segment ``fastrtps_<16 hexadecimal digits>`` (0.5 MB) with a mutex, holds a lock
(flock) on ``<name>_el`` while it lives, and removes all of it in the end. What a killed process leaves stays.

So a run lists, in a file beside them, the segments that its processes lock. At its end it removes
those that nobody locks any more; if the launcher was killed too, the next run of this user does. What is in
no such list is never touched, and neither are ports: Fast DDS reuses their names, and clears them then.
"""

import fcntl
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from typing import TextIO

FOLDER = Path("/dev/shm")  # of Linux; there is nothing to do elsewhere

_LIST = "sms_handover_"
_LOCK = "_el"
_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")


class SharedMemory:
    """The list of one run; a context manager around everything that takes part in the run."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._folder = folder
        self._list: TextIO | None = None
        self._listed: set[str] = set()

    def __enter__(self) -> "SharedMemory":
        """Remove what dead runs have left, and begin a list."""
        if os.access(self._folder, os.W_OK):
            for left in sorted(self._folder.glob(f"{_LIST}*")):
                _clear_after(left)
            path = self._folder / f"{_LIST}{os.getpid()}_{token_hex(4)}"
            self._list = open(path, "x", encoding="ascii", opener=_private)
            fcntl.flock(self._list, fcntl.LOCK_EX)
        return self

    def __exit__(self, *error: object) -> None:
        """Remove what is left of this run; the list stays while a process still holds a segment in it."""
        if self._list is not None:
            if not _remove_unlocked(self._folder, self._listed):
                Path(self._list.name).unlink(missing_ok=True)
            self._list.close()

    def note(self, pids: Iterable[int]) -> None:
        """List the segments that processes of this run hold; call it often while they start."""
        if self._list is None:
            return
        new = {name for pid in pids for name in _segments_of(pid, self._folder)} - self._listed
        if new:
            self._listed |= new
            self._list.write("".join(f"{name}\n" for name in sorted(new)))
            self._list.flush()


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _segments_of(pid: int, folder: Path) -> Iterator[str]:
    """Yield the segments that a process holds; none if it has ended."""
    with suppress(OSError):
        for entry in os.scandir(f"/proc/{pid}/fd"):
            with suppress(OSError):
                target = Path(os.readlink(entry.path))
                name = target.name.removesuffix(_LOCK)
                if target.parent == folder and target.name.endswith(_LOCK) and _SEGMENT.fullmatch(name):
                    yield name


def _clear_after(left: Path) -> None:
    """Remove the segments in a list, and the list, if its run has ended and was this user's."""
    with suppress(OSError), left.open(encoding="ascii") as file:
        if os.fstat(file.fileno()).st_uid != os.geteuid():
            return
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        listed = {name for name in file.read().splitlines() if _SEGMENT.fullmatch(name)}
        if not _remove_unlocked(left.parent, listed):
            left.unlink(missing_ok=True)


def _remove_unlocked(folder: Path, names: Iterable[str]) -> list[str]:
    """Remove the segments that nobody locks; return those that somebody does."""
    held = []
    for name in names:
        files = (folder / name, folder / f"sem.{name}_mutex", folder / f"{name}{_LOCK}")
        if not (files[0].exists() or files[-1].exists()):
            continue
        with suppress(OSError), files[-1].open("ab") as lock:  # made if only the memory is left
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                held.append(name)
                continue
            for file in files:
                file.unlink(missing_ok=True)
    return held
