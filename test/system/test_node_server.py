"""A node that the server has forked is like one that was started by itself, but for the time it takes."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from sms_handover.errors import GraphError
from sms_handover.launcher import node_server
from sms_handover.launcher.domain import reserved_domain
from sms_handover.launcher.interrupts import Interrupts
from sms_handover.launcher.node_server import ForkedProcess, NodeServer
from sms_handover.launcher.processes import NodeProcesses
from sms_handover.process_status import process_status
from sms_handover.ros.process.launcher_process import LAUNCHER_PID

from .runs import DEADLINE_S, has_ended

pytestmark = [pytest.mark.system, pytest.mark.slow]

WAITS = ["--ros-args", "-p", "autostart:=false"]
UNKNOWN = ["--ros-args", "-p", "nonsense:=1"]


def test_a_forked_node_has_command_session_log_and_exit_code_of_its_own(tmp_path: Path) -> None:
    lock = os.open(tmp_path / "lock", os.O_CREAT)
    with reserved_domain(None) as domain, NodeServer() as server:
        environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with NodeProcesses(tmp_path, environment, [lock], server) as processes:
            processes.start("ik", WAITS)
            processes.start("controller", UNKNOWN)
            pid, failed = processes.ids["ik"], processes.ids["controller"]
            assert all(isinstance(item, ForkedProcess) for item in processes._processes.values())
            assert has_ended(failed, DEADLINE_S) and processes.exit_code("controller") == 2
            assert "controller: error: " in processes.text_of("controller")
            words = Path(f"/proc/{pid}/cmdline").read_bytes().rstrip(b"\0").split(b"\0")
            assert [word.decode() for word in words][1:] == ["-P", "-m", "sms_handover.nodes.ik", *WAITS]
            assert f"{LAUNCHER_PID}={os.getpid()}".encode() in Path(f"/proc/{pid}/environ").read_bytes()
            status = process_status(pid)
            assert status is not None and status.session == status.group == pid
            assert Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1] == str(os.getpid())
            held = [os.readlink(item) for item in Path(f"/proc/{pid}/fd").iterdir()]
            assert held.count(str(tmp_path / "lock")) == 1
            assert not [name for name in held if name.endswith("controller.log")]
            os.kill(pid, signal.SIGTERM)
            assert has_ended(pid, DEADLINE_S) and processes.exit_code("ik") == 0
    os.close(lock)


def test_a_server_that_does_not_answer_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it may still fork would be a second node of that name, so nothing else is started in its place."""
    monkeypatch.setattr(node_server, "_ANSWER_TIMEOUT_S", 0.01)
    with NodeServer() as server:
        server.wait_until_ready()
        os.kill(server._process.pid, signal.SIGSTOP)
        with pytest.raises(GraphError, match=r"the node server has not started 'ik' within 0\.01 s"):
            server.start("ik", UNKNOWN, {}, [1])
    assert server._process.returncode == -signal.SIGKILL  # suspended as it is


def test_a_signal_ends_the_wait_for_a_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_server, "_IMPORT_TIMEOUT_S", 10.0)
    with Interrupts() as interrupts, NodeServer() as server:
        os.kill(server._process.pid, signal.SIGSTOP)
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            server.wait_until_ready(interrupts.heed)


def test_where_there_is_no_server_a_node_starts_by_itself(tmp_path: Path) -> None:
    with NodeServer() as server:
        server._process.kill()
        server._process.wait()
        with NodeProcesses(tmp_path, {}, server=server) as processes:
            processes.start("ik", UNKNOWN)
            assert isinstance(processes._processes["ik"], subprocess.Popen)
            assert processes._processes["ik"].wait(DEADLINE_S) == 2
