"""The log of a node: what it prints, in a file that stays readable here even if it is moved or deleted."""

import os
from pathlib import Path
from typing import BinaryIO

from sms_handover.errors import GraphError

_LAST_LINES = 12  # shown when the process of the node has died
_NO_ROOM = 64 * 1024  # [byte] on a disk with less than that left, a log that is cut short is no surprise


class NodeLog:
    """The log of one node; close it in the end."""

    def __init__(self, path: Path) -> None:
        """Create the file; raises GraphError if that fails."""
        self._path = path
        try:
            self.stream: BinaryIO = path.open("wb")  # for the process of the node
            self._reader = path.open("rb")
        except OSError as error:
            raise GraphError(f"cannot write the log {path}: {error.strerror}") from error

    @property
    def text(self) -> str:
        """All that was printed so far."""
        self._reader.seek(0)
        return self._reader.read().decode(errors="replace")

    @property
    def last_lines(self) -> str:
        """The end of what was printed, and why it may be cut short."""
        lines = self.text.splitlines()[-_LAST_LINES:]
        disk = os.fstatvfs(self._reader.fileno())
        if disk.f_bavail * disk.f_frsize < _NO_ROOM:
            lines.append(f"the disk of {self._path.parent} is full, so its log may be cut short")
        return "\n".join(lines)

    def close(self) -> None:
        """Close the file."""
        self.stream.close()
        self._reader.close()
