"""However a run ends, a wrapped program of somebody else's leaves nothing behind."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

from sms_handover.launcher import processes
from sms_handover.launcher.processes import NodeProcesses

from .runs import DEADLINE_S, has_ended

# A controller that a wrapper starts: it tells its process id, and ends on SIGTERM unless told otherwise.
PROGRAM = """
import os, signal, sys
from pathlib import Path
if "deaf" in sys.argv:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
Path(sys.argv[1]).write_text(str(os.getpid()))
if "suspend" in sys.argv:
    os.kill(os.getpid(), signal.SIGSTOP)
while True:
    signal.pause()
"""
# Wrappers that pass no signal on; under timeout(1) the program is in another process group of the session.
WRAPPERS = {"group": "{} & wait", "other group": "timeout 600 {} & wait", "alone": "exec {}"}
LAUNCHER = """
import os, signal, sys
from pathlib import Path
from sms_handover.launcher.processes import NodeProcesses
with NodeProcesses(Path(sys.argv[1]), {}) as processes:
    processes.start("controller", (), sys.argv[2:])
    print(processes.ids["controller"], flush=True)
    signal.pause()
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "program.py"
    file.write_text(PROGRAM, encoding="utf-8")
    return file


def wrapped(program: Path, wrapper: str, *arguments: str) -> tuple[str, ...]:
    command = " ".join([sys.executable, str(program), str(pid_file(program)), *arguments])
    return ("bash", "-c", WRAPPERS[wrapper].format(command))


def pid_file(program: Path) -> Path:
    return program.with_name("pid")


def pid_of(program: Path) -> int:
    """Wait until the program has told its process id."""
    deadline = monotonic() + DEADLINE_S
    while not (pid_file(program).is_file() and pid_file(program).read_text()):
        assert monotonic() < deadline
        sleep(0.01)
    return int(pid_file(program).read_text())


@pytest.fixture(params=list(WRAPPERS))
def wrapper(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def pid(program: Path) -> Iterator[list[int]]:
    """What is killed if a test leaves it behind."""
    found: list[int] = []
    yield found
    for number in found:
        if not has_ended(number, 0.0):
            os.kill(number, signal.SIGKILL)


@pytest.mark.parametrize("state", ["", "suspend", "deaf"])
def test_at_the_end_of_a_run(
    state: str, wrapper: str, program: Path, pid: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if state == "deaf":
        monkeypatch.setattr(processes, "GRACE_S", 0.2)
    with NodeProcesses(tmp_path, {}) as running:
        running.start("controller", (), wrapped(program, wrapper, state))
        pid.append(pid_of(program))
        assert not has_ended(pid[0], 0.0)
    assert has_ended(pid[0], 0.0)


def test_when_the_wrapper_has_died_before(program: Path, pid: list[int], tmp_path: Path) -> None:
    with NodeProcesses(tmp_path, {}) as running:
        running.start("controller", (), wrapped(program, "group"))
        pid.append(pid_of(program))
        os.kill(running.ids["controller"], signal.SIGKILL)
        assert has_ended(running.ids["controller"], DEADLINE_S)
        assert [death.code for death in running.dead()] == [-signal.SIGKILL]
        assert not has_ended(pid[0], 0.0)
    assert has_ended(pid[0], 0.0)


@pytest.mark.parametrize("state", ["", "suspend"])
def test_when_the_launcher_is_killed(
    state: str, wrapper: str, program: Path, pid: list[int], tmp_path: Path
) -> None:
    command = [sys.executable, "-c", LAUNCHER, str(tmp_path), *wrapped(program, wrapper, state)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as launcher:
        assert launcher.stdout is not None
        leader = int(launcher.stdout.readline())
        pid.append(pid_of(program))
        launcher.kill()
    assert has_ended(pid[0], DEADLINE_S) and has_ended(leader, DEADLINE_S)
