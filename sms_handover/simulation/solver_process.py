"""Solver process of a planning law in real time: started here, and fed with problems.

It ends with the process that has started it, whatever ends that: it reads from a socket which the system then
closes.
"""

import os
import pickle
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import Any

from sms_handover.control.law import LawSetup
from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.deputy import DeputyDescription

READY = b"ready"
_PROGRAM = (sys.executable, "-m", "sms_handover.simulation.solver_main")
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
_START_S = 120.0  # [s] of wall time to import everything and, the first time, to compile
_END_S = 2.0  # [s] of wall time to end once nothing more can come


@dataclass(frozen=True, eq=False)
class SolverSetup:
    """What a solver is made from."""

    robot: RobotDescription
    deputy: DeputyDescription
    gains: tuple[Any, ...]


class _Pickler(pickle.Pickler):
    """Pickles read-only mappings too."""

    def __init__(self, stream: BytesIO) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self.dispatch_table = {MappingProxyType: lambda mapping: (_read_only_mapping, (dict(mapping),))}


def _read_only_mapping(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """Return a read-only mapping."""
    return MappingProxyType(values)


def packed(value: Any) -> bytes:
    """Return a value as bytes for the other process."""
    stream = BytesIO()
    _Pickler(stream).dump(value)
    return stream.getvalue()


class SolverProcess:
    """The process, as :class:`~sms_handover.control.protocol.RemoteSolver`; not thread-safe."""

    def __init__(self, setup: LawSetup[Any]) -> None:
        """Start it and wait until it is ready; raises ConfigurationError, SmsHandoverError."""
        if setup.deputy is None:
            raise ConfigurationError("a solver process needs the deputy that it keeps clear of")
        ours, theirs = socket.socketpair()
        with theirs:
            self._child = subprocess.Popen(
                [*_PROGRAM, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env={**os.environ, **_ONE_THREAD},
            )
        self._link = Connection(ours.detach())
        self._pending = self._dropped = 0  # problems without a solution, and those of them nobody waits for
        self._trouble = ""
        try:
            self._send(packed(SolverSetup(setup.robot.description, setup.deputy, setup.gains)))
            answer = self._receive(_START_S)
            if answer != READY:
                raise SmsHandoverError(f"the solver process cannot start: {self._trouble or 'it hangs'}")
        except BaseException:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._child.pid

    @property
    def trouble(self) -> str:
        """How it has ended, '' while it runs."""
        return self._trouble

    def submit(self, problem: Any) -> None:
        """Send a problem."""
        self._send(packed(problem))
        self._pending += 1

    def take(self) -> Any:
        """Return the next solution, None if there is none yet; never waits."""
        answer = self._receive(0.0)
        if answer is None:
            return None
        self._pending -= 1
        if self._dropped:
            self._dropped -= 1
            return None
        return pickle.loads(answer)

    def forget(self) -> None:
        """Drop the solutions of all problems so far."""
        self._dropped = self._pending

    def close(self) -> None:
        """End it: it ends once it can receive nothing more."""
        self._link.close()
        try:
            self._child.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._trouble = self._trouble or "the solver process has been closed"

    def _send(self, data: bytes) -> None:
        """Send bytes unless it has ended."""
        if not self._trouble:
            with suppress(OSError):  # the answer will tell
                self._link.send_bytes(data)

    def _receive(self, patience_s: float) -> bytes | None:
        """Return the next bytes, None if there are none in time or it has ended."""
        if self._trouble:
            return None
        try:
            return self._link.recv_bytes() if self._link.poll(patience_s) else None
        except (EOFError, OSError):
            self._trouble = f"the solver process {self._end_in_words()}"
            return None

    def _end_in_words(self) -> str:
        """Return how it has ended."""
        try:
            code = self._child.wait(_END_S)
        except subprocess.TimeoutExpired:
            return "no longer answers"
        if code >= 0:
            return f"ended with exit code {code}"
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-code).name}"
        return f"was ended by signal {-code}"
