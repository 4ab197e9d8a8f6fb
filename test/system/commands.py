"""Running ``sms-handover`` as a user does: in a process of its own, from any folder."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

from sms_handover.ros.main import LAUNCHER_PID

DEADLINE_S = 180.0  # s of wall time after which a command hangs; nothing is measured by it

COMMAND = (sys.executable, "-m", "sms_handover.cli.main")


def sms_handover(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Return what a command did that was run to its end in a folder."""
    return subprocess.run(
        [*COMMAND, *arguments], cwd=folder, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


@contextmanager
def started(folder: Path, *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """Give a command that runs in a folder; it is killed at the end if it still does."""
    process = subprocess.Popen(
        [*COMMAND, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=DEADLINE_S)


def nodes_of(launcher_pid: int) -> dict[str, int]:
    """Return the process id of every node that a launcher has started and that still runs."""
    mark = f"{LAUNCHER_PID}={launcher_pid}".encode()
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            environment = (entry / "environ").read_bytes().split(b"\0")
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue  # it has ended meanwhile, or is somebody else's
        module = next((word for word in words if word.startswith(b"sms_handover.nodes.")), None)
        if mark in environment and module is not None:
            found[module.decode().rsplit(".", 1)[1]] = int(entry.name)
    return found


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Wait for something outside of this process; fails after the deadline."""
    end = monotonic() + DEADLINE_S
    while not condition():
        assert monotonic() < end, f"{what} has not come about"
        sleep(0.05)  # there is nothing of another process to wait on but time
