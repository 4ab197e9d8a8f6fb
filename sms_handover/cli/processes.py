"""The processes of a graph: started together, watched, and ended whatever happens."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import TracebackType

from sms_handover.cli.node_log import NodeLog
from sms_handover.ros.parent import LAUNCHER_PID

_GRACE_S = 10.0  # [s] of wall time a process gets to end after a signal


@dataclass(frozen=True)
class Death:
    """A process that ended: its name, exit code, and the last lines of its log."""

    name: str
    code: int
    last_lines: str


class NodeProcesses:
    """One process per node, each in a session of its own, its output in ``<folder>/<node>.log``.

    Use it as a context manager: leaving it ends every process that is still there.
    """

    def __init__(self, log_folder: Path, environment: Mapping[str, str]) -> None:
        """Prepare; nothing is started yet."""
        self._folder = log_folder
        self._environment = {**os.environ, **environment, LAUNCHER_PID: str(os.getpid())}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._logs: dict[str, NodeLog] = {}

    def __enter__(self) -> "NodeProcesses":
        """Return the processes."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End every process that is still there."""
        self.end()
        for log in self._logs.values():
            log.close()

    def start(self, node: str, arguments: Sequence[str], program: Sequence[str] = ()) -> None:
        """Start a node or the container, of this package unless it is another ``program``.

        Raises GraphError if its log cannot be written.
        """
        program = program or (sys.executable, "-m", f"sms_handover.nodes.{node}")
        command = [*program, *arguments]
        log = self._logs[node] = NodeLog(self._folder / f"{node}.log")
        self._processes[node] = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log.stream,
            stderr=subprocess.STDOUT,
            env=self._environment,
            start_new_session=True,
        )

    def text_of(self, node: str) -> str:
        """Return what a node has printed so far."""
        return self._logs[node].text

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
        """End every process: ask by SIGINT, then SIGTERM, then kill, and wait for each."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            alive = [process for process in self._processes.values() if process.poll() is None]
            for process in alive:
                process.send_signal(number)
            deadline = monotonic() + _GRACE_S
            for process in alive:
                try:
                    process.wait(max(deadline - monotonic(), 0.01))
                except subprocess.TimeoutExpired:
                    break
