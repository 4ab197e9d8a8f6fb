"""Shared memory check: whether /dev/shm has room for Fast DDS, before rclpy is imported.

Fast DDS maps files in /dev/shm without reserving their room. If it is full, the first write to such a page
kills the process (SIGBUS). The tracing library of rclpy does the same while it is loaded.
"""

import os
from pathlib import Path

from sms_handover.errors import GraphError

_SHARED_MEMORY = Path("/dev/shm")
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"  # environment variable that Fast DDS reads
_TRACING = 16 * 2**10  # [byte] that the import of rclpy needs
_ROOM = 16 * 2**20  # [byte] four times what the processes of a run map together


def require_shared_memory(folder: Path = _SHARED_MEMORY) -> None:
    """Raise GraphError if shared memory is so full that rclpy cannot be imported."""
    room = _room(folder)
    if room is not None and room < _TRACING:
        raise GraphError(f"{folder} is full, so ROS cannot be started: remove what fills it")


def avoid_full_shared_memory(folder: Path = _SHARED_MEMORY) -> str:
    """Let this process and its children send by UDP only if shared memory has too little room.

    Returns why in words, "" if there is room or if the user has chosen the transports.
    """
    room = _room(folder)
    if room is None or room >= _ROOM or _TRANSPORTS in os.environ:
        return ""
    os.environ[_TRANSPORTS] = "UDPv4"
    mib, needed = room / 2**20, _ROOM / 2**20
    return f"{folder} has {mib:.1f} MiB left, a run takes up to {needed:g}: messages go by UDP"


def _room(folder: Path) -> int | None:
    """Return the bytes left, None if there is no shared memory, which Fast DDS handles."""
    try:
        disk = os.statvfs(folder)
    except OSError:
        return None
    return disk.f_bavail * disk.f_frsize
