"""A node ends with whoever is responsible for it, and with nobody else."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sms_handover.ros.process.launcher_process import LAUNCHER_PID

from ..system.runs import DEADLINE_S, has_ended

pytestmark = pytest.mark.ros

# A node without the middleware: it tells its process id, and ends when Stop says so.
NODE = """
import os, signal, sys
from sms_handover.ros.process.main import Stop
stop = Stop()
print(os.getpid(), flush=True)
if "suspend" in sys.argv:
    os.kill(os.getpid(), signal.SIGSTOP)
while not stop.asked:
    signal.sigtimedwait([], 0.01)
"""
# What stands between: it starts the node, and waits for it.
STARTER = (
    "import os, subprocess, sys; sys.exit(subprocess.run([sys.executable, *sys.argv[{skip}:]]).returncode)"
)


@pytest.fixture
def node(tmp_path: Path) -> Iterator[list[str]]:
    """The arguments of Python that run a node."""
    file = tmp_path / "node.py"
    file.write_text(NODE, encoding="utf-8")
    yield [str(file)]


@pytest.fixture(autouse=True)
def no_launcher(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LAUNCHER_PID, raising=False)


def start(command: list[str]) -> tuple["subprocess.Popen[str]", int]:
    """Start a command and return it with the process id that the node prints."""
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def kill(process: "subprocess.Popen[str]") -> None:
    process.kill()
    process.wait()
    assert process.stdin is not None and process.stdout is not None
    process.stdout.close()


def test_a_node_of_ros2_run_ends_when_that_is_killed(node: list[str], tmp_path: Path) -> None:
    ros2 = tmp_path / "ros2"
    ros2.write_text(STARTER.format(skip=4), encoding="utf-8")
    process, pid = start([sys.executable, str(ros2), "run", "sms_handover", "plant", *node])
    kill(process)
    assert has_ended(pid, DEADLINE_S)


def test_a_node_that_a_shell_has_started_outlives_it(node: list[str]) -> None:
    process, pid = start([sys.executable, "-c", STARTER.format(skip=1), *node])
    kill(process)
    try:
        assert not has_ended(pid, 0.5)
    finally:
        os.kill(pid, signal.SIGTERM)
    assert has_ended(pid, DEADLINE_S)


def test_a_suspended_node_wakes_to_end_when_its_launcher_is_killed(
    node: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody else would wake it, and SIGTERM waits for that."""
    command = "import os; os.environ['" + LAUNCHER_PID + "'] = str(os.getpid()); " + STARTER.format(skip=1)
    process, pid = start([sys.executable, "-c", command, *node, "suspend"])
    while Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0] != "T":
        assert not has_ended(pid, 0.01)
    kill(process)
    assert has_ended(pid, DEADLINE_S)


def test_a_program_of_others_is_ended_with_its_launcher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "theirs.py"
    file.write_text("import os, sys\nprint(os.getpid(), flush=True)\nos.read(0, 1)\n", encoding="utf-8")
    command = "import os; os.environ['" + LAUNCHER_PID + "'] = str(os.getpid()); " + STARTER.format(skip=1)
    ward = ("-m", "sms_handover.ros.process.launcher_process", sys.executable, str(file))
    process, pid = start([sys.executable, "-c", command, *ward])
    assert not has_ended(pid, 0.1)
    kill(process)
    assert has_ended(pid, DEADLINE_S)


def test_a_hang_up_that_is_ignored_stays_so(node: list[str]) -> None:
    """As with nohup(1): the session of whoever started it may end."""
    process, pid = start(["nohup", sys.executable, *node])
    os.kill(pid, signal.SIGHUP)
    assert not has_ended(pid, 0.5)
    os.kill(pid, signal.SIGTERM)
    assert process.wait(DEADLINE_S) == 0
    kill(process)
