"""What the dead leave in shared memory is removed; what the living hold, and what is not ours, stays."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sms_handover.launcher.shared_memory import SharedMemory

# A participant as Fast DDS makes one: a segment and a port, with locks that are held; it waits to be ended.
PARTICIPANT = """
import fcntl, sys
from pathlib import Path
folder, held = Path(sys.argv[1]), []
for name in sys.argv[2:]:
    (folder / name).touch()
    (folder / f"sem.{name}_mutex").touch()
    held.append((folder / f"{name}_el").open("wb"))
    fcntl.flock(held[-1], fcntl.LOCK_EX)
print("up", flush=True)
sys.stdin.read()
"""
SEGMENT, PORT, OTHER = "fastrtps_0123456789abcdef", "fastrtps_port7411", "fastrtps_fedcba9876543210"

# A run that is killed with its participant.
RUN = """
import os, signal, sys
from pathlib import Path
from sms_handover.launcher.shared_memory import SharedMemory
with SharedMemory(Path(sys.argv[1])) as memory:
    memory.note([int(sys.argv[2])])
    os.kill(os.getpid(), signal.SIGKILL)
"""


@contextmanager
def participant(folder: Path, *names: str) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-c", PARTICIPANT, str(folder), *names]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "up\n"
        try:
            yield process
        finally:
            process.kill()


def killed(memory: SharedMemory, folder: Path) -> None:
    """Let a process of the run, with a segment and a port, be killed."""
    with participant(folder, SEGMENT, PORT) as process:
        memory.note([process.pid])
        process.kill()
        process.wait()


def files(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def of(name: str) -> set[str]:
    return {name, f"{name}_el", f"sem.{name}_mutex"}


def test_what_a_killed_process_leaves_is_removed_at_the_end_of_its_run(tmp_path: Path) -> None:
    with participant(tmp_path, OTHER) as stranger:
        with SharedMemory(tmp_path) as memory:
            killed(memory, tmp_path)
            assert files(tmp_path) >= of(SEGMENT)
        assert files(tmp_path) == of(OTHER) | of(PORT)
        stranger.kill()
        stranger.wait()
        with SharedMemory(tmp_path):
            pass
        assert files(tmp_path) == of(OTHER) | of(PORT)  # of the dead, but not of ours


def test_what_the_living_hold_stays(tmp_path: Path) -> None:
    """Then the list stays too, so that a later run finds what is left when they have been killed."""
    with participant(tmp_path, SEGMENT) as process:
        with SharedMemory(tmp_path) as memory:
            memory.note([process.pid])
        assert files(tmp_path) > of(SEGMENT)
        with SharedMemory(tmp_path):
            pass
        assert files(tmp_path) > of(SEGMENT)
    with SharedMemory(tmp_path):
        pass
    assert files(tmp_path) == set()


def test_the_next_run_removes_what_is_left_when_everything_was_killed(tmp_path: Path) -> None:
    with participant(tmp_path, SEGMENT) as process:
        command = [sys.executable, "-c", RUN, str(tmp_path), str(process.pid)]
        assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert files(tmp_path) > of(SEGMENT)
    with SharedMemory(tmp_path):
        pass
    assert files(tmp_path) == set()


def test_ports_are_never_touched(tmp_path: Path) -> None:
    """Their names are reused by any graph of the machine; Fast DDS clears them when it reuses one."""
    with SharedMemory(tmp_path) as memory:
        killed(memory, tmp_path)
    assert files(tmp_path) == of(PORT)


def test_the_list_of_a_run_that_goes_on_is_left_alone(tmp_path: Path) -> None:
    with SharedMemory(tmp_path), SharedMemory(tmp_path):
        assert len(files(tmp_path)) == 2
    assert files(tmp_path) == set()


@pytest.mark.parametrize(
    "line",
    [
        "../../etc/passwd",
        "lttng-ust-wait-6",
        "sem.other",
        "fastrtps_port7411",
        "fastrtps_0123456789abcdef/../lttng-ust-wait-6",
        "",
    ],
)
def test_a_list_that_was_tampered_with_removes_nothing_else(line: str, tmp_path: Path) -> None:
    folder = tmp_path / "shm"
    folder.mkdir()
    others = {"lttng-ust-wait-6", "sem.other", PORT}
    for name in others:
        (folder / name).touch()
    (folder / "sms_handover_1_0").write_text(f"{line}\n", encoding="ascii")
    with SharedMemory(folder):
        pass
    assert files(folder) == others


def test_others_may_not_read_the_list(tmp_path: Path) -> None:
    with SharedMemory(tmp_path):
        (made,) = tmp_path.iterdir()
        assert made.stat().st_mode & 0o077 == 0


def test_without_shared_memory_nothing_is_done(tmp_path: Path) -> None:
    with SharedMemory(tmp_path / "none") as memory:
        memory.note([os.getpid()])
