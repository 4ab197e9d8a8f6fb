"""One node as a process: exit codes, one line for every error, an orderly end on a signal."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import Executor

from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.nodes import controller, ik, plant, recorder, trajectory
from sms_handover.ros.process.launcher_process import LAUNCHER_PID
from sms_handover.ros.process.main import EXIT_FAILED, EXIT_OK, EXIT_USAGE, RunnableNode, Stop, run_node

from ..system.runs import DEADLINE_S
from .bench import Bench

pytestmark = pytest.mark.ros

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
MAINS = {
    module.__name__.rsplit(".", 1)[1]: module.main for module in (plant, trajectory, ik, controller, recorder)
}


@pytest.fixture(autouse=True)
def handlers(bench: Bench) -> Iterator[None]:
    """Put back what a node does with signals, and use the domain and the environment of the bench."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def own_domain(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.delenv(LAUNCHER_PID, raising=False)


class Worker(RunnableNode):
    """A node that does what it is told once."""

    def __init__(self, work: Callable[[Stop], None] = lambda stop: None, code: int = EXIT_OK) -> None:
        """Take the work and the exit code."""
        super().__init__("worker", start_parameter_services=False)
        self._work, self._code = work, code

    def run(self, executor: Executor, stop: Stop) -> int:
        """Do the work, and wait for the end."""
        self._work(stop)
        return self._code


def fail(error: Exception) -> Callable[[Stop], None]:
    def work(stop: Stop) -> None:
        raise error

    return work


def test_exit_code_is_that_of_the_node() -> None:
    assert run_node(lambda: Worker(code=3), []) == 3
    assert not rclpy.ok()


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ConfigurationError("bad value"), EXIT_USAGE),
        (GraphError("a reader is stuck"), EXIT_FAILED),
        (BagError("the disk is full"), EXIT_FAILED),
    ],
)
def test_an_error_is_one_line(capfd: pytest.CaptureFixture[str], error: Exception, code: int) -> None:
    assert run_node(lambda: Worker(fail(error)), []) == code
    assert capfd.readouterr().err == f"worker: error: {error}\n"
    assert not rclpy.ok()


def test_an_error_of_the_making_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    def make() -> Worker:
        raise ConfigurationError("bad value")

    assert run_node(make, []) == EXIT_USAGE
    assert capfd.readouterr().err == "node: error: bad value\n"


def test_the_name_of_the_node_is_told_once(capfd: pytest.CaptureFixture[str]) -> None:
    assert MAINS["controller"](["controller", "--ros-args", "-p", "law:=fast"]) == EXIT_USAGE
    assert capfd.readouterr().err.startswith("controller: error: parameter 'law': unknown control law 'fast'")


def test_a_bug_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        run_node(lambda: Worker(fail(ZeroDivisionError())), [])
    assert not rclpy.ok()


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_asks_for_an_orderly_end(number: signal.Signals) -> None:
    asked: list[bool] = []

    def work(stop: Stop) -> None:
        asked.append(stop.asked)
        os.kill(os.getpid(), number)
        asked.append(stop.asked)

    assert run_node(lambda: Worker(work), []) == EXIT_OK
    assert asked == [False, True]


def test_a_spinning_node_ends_on_a_signal() -> None:
    class Spinner(RunnableNode):
        def __init__(self) -> None:
            super().__init__("spinner", start_parameter_services=False)
            self.create_timer(0.01, lambda: os.kill(os.getpid(), signal.SIGTERM))

        def run(self, executor: Executor, stop: Stop) -> int:
            while not stop.asked:
                executor.spin_once(timeout_sec=0.2)
            return EXIT_OK

    assert run_node(Spinner, []) == EXIT_OK


def pid_of_nobody() -> int:
    """Return the id of a process that has ended."""
    with subprocess.Popen(["true"]) as process:
        return process.pid


def test_a_node_ends_when_its_launcher_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LAUNCHER_PID, str(os.getppid()))
    assert not Stop().asked
    monkeypatch.setenv(LAUNCHER_PID, str(pid_of_nobody()))
    assert Stop().asked


BAD: dict[str, tuple[str, ...]] = {
    "controller": ("law:=fast", "unknown control law 'fast'"),
    "plant": ("grasp_position_tolerance:=-0.01", "-0.01 m, must be >= 0 m"),
    "trajectory": ("time_law:=cubic", "unknown value 'cubic'"),
    "ik": ("max_iterations:=0", "is 0, must be >= 1"),
    "recorder": ("drain_timeout:=nothing", "'nothing', must be a number in s"),
}


@pytest.mark.parametrize("name", list(MAINS))
def test_a_bad_parameter_ends_a_node_with_one_line(
    name: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    value, text = BAD[name]
    assert MAINS[name]([name, "--ros-args", "-p", value]) == EXIT_USAGE
    lines = capfd.readouterr().err.splitlines()
    assert [line for line in lines if "error:" in line] == lines[-1:]
    assert text in lines[-1]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("handover")]  # no bag was begun


def test_an_argument_that_ros_does_not_know_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    """A parameter without ``--ros-args -p`` would otherwise change nothing, silently."""
    assert MAINS["plant"](["plant", "integrator:=midpoint"]) == EXIT_USAGE
    assert capfd.readouterr().err.startswith("plant: error: unknown argument 'integrator:=midpoint'; give")
    assert not rclpy.ok()


IMPATIENT = """
from sms_handover.ros.process.main import RunnableNode, run_node

class Worker(RunnableNode):
    def __init__(self):
        super().__init__("worker", start_parameter_services=False)

    def run(self, executor, stop):
        print("up", flush=True)
        while not stop.asked:
            executor.spin_once(timeout_sec=0.01)
        return 3

raise SystemExit(run_node(Worker, ["worker"]))
"""


def test_a_signal_on_the_way_out_keeps_the_exit_code() -> None:
    """A terminal and a launcher may both send SIGINT, so that one comes while the interpreter ends."""
    with subprocess.Popen([sys.executable, "-c", IMPATIENT], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.returncode == 3


HANGING = """
from sms_handover.ros.process import main
from sms_handover.ros.process.main import RunnableNode, run_node

class Worker(RunnableNode):
    def run(self, executor, stop):
        return 0

    def destroy_node(self):
        while True:
            pass

main._TEARDOWN_S = 0.2
raise SystemExit(run_node(lambda: Worker("worker"), ["worker"]))
"""


def test_a_node_that_hangs_at_its_end_tells_where_and_ends() -> None:
    done = subprocess.run([sys.executable, "-c", HANGING], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "in destroy_node" in done.stderr


HANGING_LATER = """
import atexit, ctypes, sys

hang = lambda: ctypes.PyDLL(None).sleep(1000)  # s; it keeps the lock of the interpreter
if "exit" in sys.argv:
    atexit.register(hang)  # before ours, so it is called after it

from sms_handover.ros.process import launcher_watch, main
from sms_handover.ros.process.main import RunnableNode, run_node

class Worker(RunnableNode):
    def run(self, executor, stop):
        if "run" in sys.argv:
            while not stop.asked:
                executor.spin_once(timeout_sec=0.01)
            hang()
        return 0

launcher_watch._GRACE_S = 0.2
main._TEARDOWN_S = 1
raise SystemExit(run_node(lambda: Worker("worker"), ["worker"]))
"""


def test_a_node_that_hangs_in_the_exit_of_the_interpreter_is_ended() -> None:
    done = subprocess.run([sys.executable, "-c", HANGING_LATER, "exit"], timeout=DEADLINE_S, check=False)
    assert done.returncode == -signal.SIGALRM


def test_a_node_that_hangs_when_its_launcher_is_gone_tells_where_and_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the thread of Python's that would notice it is never let on."""
    monkeypatch.setenv(LAUNCHER_PID, str(pid_of_nobody()))
    command = [sys.executable, "-c", HANGING_LATER, "run"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 1
    assert "in run" in done.stderr


@pytest.mark.parametrize("name", list(MAINS))
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("-p", "no_such_parameter:=1"), "unknown parameter 'no_such_parameter'"),
        (("-p", "robot:=/no/such/robot.yaml"), "cannot read /no/such/robot.yaml"),
        (("-p", "mode:=fast"), "unknown value 'fast'"),
        (("-p", "peers:=[plant, wheel]"), "unknown node 'wheel'"),
        (("-p", "tick"), "-p tick"),
        (("--no-such-flag",), "--no-such-flag"),
        (("--params-file", "/no/such/file.yaml"), "/no/such/file.yaml"),
    ],
)
def test_bad_arguments_end_every_node_with_one_line(
    name: str,
    arguments: tuple[str, ...],
    text: str,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert MAINS[name]([name, "--ros-args", *arguments]) == EXIT_USAGE
    lines = capfd.readouterr().err.splitlines()
    assert [line for line in lines if "error:" in line] == lines[-1:]
    assert text in lines[-1]
    assert not rclpy.ok()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("handover")]
