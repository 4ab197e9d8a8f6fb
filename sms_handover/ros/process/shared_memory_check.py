"""How Fast DDS is to send where shared memory has no room.

Fast DDS maps files in /dev/shm without asking for their room first. On a full one the first write to such
a page kills the process (SIGBUS), whatever the process would do about it. To be asked before rclpy is
imported: the tracing library that comes with it does the same as it is loaded, with a page of its own.
"""

import os
from pathlib import Path

from sms_handover.errors import GraphError

_SHARED_MEMORY = Path("/dev/shm")
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"  # environment variable that Fast DDS reads
_TRACING = 16 * 2**10  # [byte] without which rclpy cannot even be imported
_ROOM = 16 * 2**20  # [byte] four times what the processes of a run map together


def require_shared_memory(folder: Path = _SHARED_MEMORY) -> None:
    """Raise GraphError where shared memory is so full that rclpy cannot even be imported."""
    room = _room(folder)
    if room is not None and room < _TRACING:
        raise GraphError(f"{folder} is full, so ROS cannot be started: remove what fills it")


def avoid_full_shared_memory(folder: Path = _SHARED_MEMORY) -> str:
    """Let this process and its children send by UDP alone where shared memory has too little room.

    Returns what was found in words, '' where there is room or the user has chosen transports.
    """
    room = _room(folder)
    if room is None or room >= _ROOM or _TRANSPORTS in os.environ:
        return ""
    os.environ[_TRANSPORTS] = "UDPv4"
    mib, needed = room / 2**20, _ROOM / 2**20
    return f"{folder} has {mib:.1f} MiB left, a run takes up to {needed:g}: messages go by UDP"


def _room(folder: Path) -> int | None:
    """Return the bytes left, None where there is no shared memory; Fast DDS notices that by itself."""
    try:
        disk = os.statvfs(folder)
    except OSError:
        return None
    return disk.f_bavail * disk.f_frsize
