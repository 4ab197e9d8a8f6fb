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


def made_anew(folder: Path, *names: str) -> None:
    """Put new files in the place of old ones; those are kept, so that their inodes are not given again."""
    for name in names:
        (folder / name).rename(folder / f"old_{name}")
        (folder / name).touch()


def files(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def of(name: str) -> set[str]:
    return {name, f"{name}_el", f"sem.{name}_mutex"}


def test_what_a_killed_process_leaves_is_removed_at_the_end_of_its_run(tmp_path: Path) -> None:
    with participant(tmp_path, OTHER) as stranger:
        with SharedMemory(tmp_path) as memory:
            killed(memory, tmp_path)
            assert files(tmp_path) >= of(SEGMENT) | of(PORT)
        assert files(tmp_path) == of(OTHER)
        stranger.kill()
        stranger.wait()
        with SharedMemory(tmp_path):
            pass
        assert files(tmp_path) == of(OTHER)  # of the dead, but not of ours


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
    with participant(tmp_path, SEGMENT, PORT) as process:
        command = [sys.executable, "-c", RUN, str(tmp_path), str(process.pid)]
        assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert files(tmp_path) > of(SEGMENT) | of(PORT)
    with SharedMemory(tmp_path):
        pass
    assert files(tmp_path) == set()


def test_a_port_whose_reader_has_let_go_is_removed(tmp_path: Path) -> None:
    """So it is left when the reader ended in order and a writer was killed."""
    with SharedMemory(tmp_path) as memory:
        killed(memory, tmp_path)
        (tmp_path / f"{PORT}_el").unlink()
    assert files(tmp_path) == set()


def test_a_port_stays_where_nobody_was_killed(tmp_path: Path) -> None:
    """A writer goes on, and who needs the port next may be locking it at this moment."""
    with SharedMemory(tmp_path) as memory:
        killed(memory, tmp_path)
        for name in of(SEGMENT) | {f"{PORT}_el"}:
            (tmp_path / name).unlink()
    assert files(tmp_path) == of(PORT) - {f"{PORT}_el"}


@pytest.mark.parametrize("taken", [(PORT, f"{PORT}_el"), (f"{PORT}_el",)], ids=["made anew", "taken over"])
def test_a_port_that_another_graph_has_taken_since_is_not_even_tried(
    taken: tuple[str, ...], tmp_path: Path
) -> None:
    """It is about to take the lock: a lock tried here would make it believe that the port is not free."""
    with SharedMemory(tmp_path) as memory:
        killed(memory, tmp_path)
        made_anew(tmp_path, *taken)
        before = (tmp_path / f"{PORT}_el").stat()
    assert files(tmp_path) >= of(PORT)
    assert (tmp_path / f"{PORT}_el").stat() == before


def test_a_port_that_another_graph_has_just_made_stays(tmp_path: Path) -> None:
    """The memory is made first, the lock after it."""
    with SharedMemory(tmp_path) as memory:
        killed(memory, tmp_path)
        made_anew(tmp_path, PORT)
        (tmp_path / f"{PORT}_el").unlink()
    assert files(tmp_path) >= {PORT}


def test_the_list_of_a_run_that_goes_on_is_left_alone(tmp_path: Path) -> None:
    with SharedMemory(tmp_path), SharedMemory(tmp_path):
        assert len(files(tmp_path)) == 2
    assert files(tmp_path) == set()


@pytest.mark.parametrize(
    "line",
    [
        "../../etc/passwd",
        "lttng-ust-wait-6 1 2",
        "sem.other 1 2",
        "fastrtps_port7411 1 2",
        "fastrtps_port7411 1",
        "",
    ],
)
def test_a_list_that_was_tampered_with_removes_nothing_else(line: str, tmp_path: Path) -> None:
    folder = tmp_path / "shm"
    folder.mkdir()
    (folder / "lttng-ust-wait-6").touch()
    (folder / "sms_handover_1_0").write_text(f"{line}\n", encoding="ascii")
    with SharedMemory(folder):
        pass
    assert files(folder) == {"lttng-ust-wait-6"}


def test_others_may_not_read_the_list(tmp_path: Path) -> None:
    with SharedMemory(tmp_path):
        (made,) = tmp_path.iterdir()
        assert made.stat().st_mode & 0o077 == 0


def test_without_shared_memory_nothing_is_done(tmp_path: Path) -> None:
    with SharedMemory(tmp_path / "none") as memory:
        memory.note([os.getpid()])
