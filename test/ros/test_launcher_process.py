"""A node ends with whoever is responsible for it, and with nobody else."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

from sms_handover.ros.process import launcher_watch
from sms_handover.ros.process.launcher_process import (
    LAUNCHER_PID,
    LAUNCHER_START,
    LauncherProcess,
    launcher_of_this_process,
)

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
# A launcher, which names itself to what it starts.
LAUNCHER = """
import os, subprocess, sys
from sms_handover.ros.process.launcher_process import launcher_environment
sys.exit(subprocess.run(sys.argv[1:], env={**os.environ, **launcher_environment()}).returncode)
"""
WRAPPERS = {"direct": (), "bash": ("bash", "-c", '"$@" & wait', "bash"), "env": ("nice", "timeout", "600")}


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


@pytest.mark.parametrize("wrapper", list(WRAPPERS))
def test_a_node_ends_with_its_launcher_and_not_before_whatever_wraps_it(
    wrapper: str, node: list[str]
) -> None:
    process, pid = start([sys.executable, "-c", LAUNCHER, *WRAPPERS[wrapper], sys.executable, *node])
    assert not has_ended(pid, 0.5)
    kill(process)
    assert has_ended(pid, DEADLINE_S)


def test_a_suspended_node_wakes_to_end_when_its_launcher_is_killed(node: list[str]) -> None:
    """Nobody else would wake it, and SIGTERM waits for that."""
    process, pid = start([sys.executable, "-c", LAUNCHER, sys.executable, *node, "suspend"])
    while Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0] != "T":
        assert not has_ended(pid, 0.01)
    kill(process)
    assert has_ended(pid, DEADLINE_S)


def test_a_later_process_with_the_id_of_the_launcher_is_not_taken_for_it() -> None:
    here = LauncherProcess.of(os.getpid())
    assert here.running and here.start is not None
    named = {LAUNCHER_PID: str(here.pid), LAUNCHER_START: str(here.start - 1)}
    earlier = launcher_of_this_process(named)
    assert earlier is not None and not earlier.running
    assert launcher_of_this_process({**named, LAUNCHER_START: str(here.start)}) == here
    with subprocess.Popen(["true"]) as process:
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert not LauncherProcess.of(process.pid).running  # ended, but not yet reaped


@pytest.mark.parametrize("by_handle", [True, False])
def test_the_end_of_a_launcher_is_noticed_with_and_without_a_handle_of_it(
    by_handle: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not by_handle:
        monkeypatch.delattr(os, "pidfd_open")
        monkeypatch.setattr(launcher_watch, "_POLL_PERIOD_S", 0.01)
    monkeypatch.setattr("faulthandler.dump_traceback_later", lambda *_, **__: None)
    with subprocess.Popen(["sleep", "600"]) as process:
        watch = launcher_watch.LauncherWatch(LauncherProcess.of(process.pid))
        assert not watch.launcher_has_ended
        process.kill()
        deadline = monotonic() + DEADLINE_S
        while not watch.launcher_has_ended:
            assert monotonic() < deadline
            sleep(0.01)


def test_a_hang_up_that_is_ignored_stays_so(node: list[str]) -> None:
    """As with nohup(1): the session of whoever started it may end."""
    process, pid = start(["nohup", sys.executable, *node])
    os.kill(pid, signal.SIGHUP)
    assert not has_ended(pid, 0.5)
    os.kill(pid, signal.SIGTERM)
    assert process.wait(DEADLINE_S) == 0
    kill(process)
