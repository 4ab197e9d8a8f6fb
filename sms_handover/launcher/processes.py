"""The processes of a graph: started together, monitored, and ended whatever happens."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sms_handover.launcher.node_log import NodeLog
from sms_handover.launcher.node_server import NODE_MODULES, ForkedProcess, NodeServer
from sms_handover.launcher.process_sessions import GRACE_S, SessionGuard, end_sessions
from sms_handover.ros.process.launcher_process import launcher_environment

_WITHOUT_FOLDER = (  # python -P is new in 3.11
    "import sys; del sys.path[0]; from runpy import run_module; "
    "run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)"
)


@dataclass(frozen=True)
class Death:
    """A process that ended: its name, exit code, and the last lines of its log."""

    name: str
    code: int
    last_lines: str

    @property
    def how(self) -> str:
        """How it ended, in words."""
        if self.code >= 0:
            return f"ended with exit code {self.code}"
        try:
            name = signal.Signals(-self.code).name
        except ValueError:
            name = "a real-time signal"
        return f"was killed by signal {-self.code} ({name})"


class NodeProcesses:
    """One process per node, each in a session of its own, its output in ``<folder>/<node>.log``.

    A context manager: leaving it ends every process.
    """

    def __init__(
        self,
        log_folder: Path,
        environment: Mapping[str, str],
        inherited: Sequence[int] = (),
        server: NodeServer | None = None,
    ) -> None:
        """Start nothing yet; every process will keep the ``inherited`` file descriptors open.

        A ``server`` forks the nodes that are ours, which is quicker than to start each by itself.
        """
        self._folder, self._inherited, self._server = log_folder, inherited, server
        self._environment = {**os.environ, **environment, **launcher_environment()}
        self._processes: dict[str, subprocess.Popen[bytes] | ForkedProcess] = {}
        self._logs: dict[str, NodeLog] = {}
        self._guard: SessionGuard | None = None

    def __enter__(self) -> "NodeProcesses":
        return self

    def __exit__(self, *error: object) -> None:
        self.end()
        if self._guard is not None:
            self._guard.close()
        for log in self._logs.values():
            log.close()

    def start(self, node: str, arguments: Sequence[str], program: Sequence[str] = ()) -> None:
        """Start a node or the container, of this package unless it is another ``program``.

        Another program need not know of the launcher: a guard ends it, with all it has started, if this
        process is killed. Raises GraphError if the log cannot be written.
        """
        if program and self._guard is None:
            self._guard = SessionGuard(self._inherited)
        log = self._logs[node] = NodeLog(self._folder / f"{node}.log")
        if not program and self._server is not None:
            descriptors = (log.stream.fileno(), *self._inherited)
            forked = self._server.start(node, arguments, self._environment, descriptors)
            if forked is not None:
                self._processes[node] = forked
                return
        self._processes[node] = subprocess.Popen(
            (*(program or as_program(f"{NODE_MODULES}.{node}")), *arguments),
            stdin=subprocess.DEVNULL,
            stdout=log.stream,
            stderr=subprocess.STDOUT,
            env=self._environment,
            start_new_session=True,
            pass_fds=self._inherited,
        )
        if program and self._guard is not None:
            self._guard.add(self._processes[node].pid)

    def text_of(self, node: str) -> str:
        """Return what a node has printed so far."""
        return self._logs[node].text

    @property
    def ids(self) -> dict[str, int]:
        """The process id of every node that was started."""
        return {name: process.pid for name, process in self._processes.items()}

    def suspended(self) -> dict[str, int]:
        """Return the process ids of the nodes that are stopped and were not continued, by name."""
        if not hasattr(os, "waitid"):  # macOS has it from Python 3.13 on
            return {}
        return {name: pid for name, pid in self.ids.items() if _is_stopped(pid)}

    def exit_code(self, node: str) -> int | None:
        """Return the exit code of a node that has ended, else None."""
        return self._processes[node].poll()

    def dead(self) -> list[Death]:
        """Return the processes that have ended by themselves."""
        codes = {name: process.poll() for name, process in self._processes.items()}
        return [
            Death(name, code, self._logs[name].last_lines) for name, code in codes.items() if code is not None
        ]

    def end(self) -> None:
        """End every process and all that it has started, also where the process itself has ended before."""
        names = {process.pid: name for name, process in self._processes.items()}
        for session in end_sessions(names, GRACE_S):
            print(f"node {names[session]!r} did not end within {GRACE_S:g} s and was killed", file=sys.stderr)
        for process in self._processes.values():
            process.wait()


def as_program(module: str) -> tuple[str, ...]:
    """Return the command that runs a module, with no module from the folder the user stands in."""
    if sys.version_info >= (3, 11):
        return sys.executable, "-P", "-m", module
    return sys.executable, "-c", _WITHOUT_FOLDER, module


def _is_stopped(pid: int) -> bool:
    """Whether a child is stopped now; its status stays available to others who wait for it."""
    try:
        return os.waitid(os.P_PID, pid, os.WSTOPPED | os.WNOHANG | os.WNOWAIT) is not None
    except ChildProcessError:  # it has ended and was reaped
        return False
