"""Process that carries out cases, watched from outside: one that hangs, dies or eats memory is a row too."""

import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from base64 import b64decode
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from select import select
from typing import IO, NamedTuple

from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task, row_of
from sms_handover.campaign.cases.case_session import CaseGuard, end_session, takes_more
from sms_handover.campaign.definition.campaign_file import Limits
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.campaign.sampling.streams import run_seed
from sms_handover.errors import ConfigurationError, SmsHandoverError

_SAFE_PATH = ("-P",) if sys.version_info >= (3, 11) else ()  # no module from the folder the user stands in
CASE_PROGRAM = (sys.executable, *_SAFE_PATH, "-m", "sms_handover.campaign.cases.case_main")
_START_S = 300.0  # [s] to import everything and, the first time, to compile
_LOOK_S = 0.05  # [s] between two looks at the memory
_END_S = 1.0  # [s] to end when asked to, so that Ctrl-C takes a few seconds
_READ = 1 << 16  # [byte]
_LONGEST_SAID = 4096  # [byte] of standard error that are kept
_LONGEST_LINE = 200  # [characters] of it in a cause
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


class Done(NamedTuple):
    """A finished case: its row, what was measured beside it, and its trajectory if it is kept."""

    row: Row
    beside: Beside
    trajectory: bytes = b""


class CaseProcess:
    """A child process that runs cases one after the other; it is started again after a bad end."""

    def __init__(
        self,
        frozen: Frozen,
        cases: int | None,
        seed: int,
        limits: Limits,
        program: Sequence[str] = CASE_PROGRAM,
    ) -> None:
        """Take what the child needs; it starts with the first task."""
        self._first: dict[str, object] = {"files": dict(frozen.files), "cases": cases}
        self._seed, self._limits, self._program = seed, limits, tuple(program)
        self._child: subprocess.Popen[bytes] | None = None
        self._scratch: Path | None = None
        self._guard: CaseGuard | None = None
        self._pending, self._said, self._killed = b"", b"", False

    def run(self, task: Task) -> Done:
        """Return what comes of a task; raises SmsHandoverError if the child cannot even start.

        One that is killed as it starts is started again, as often as one that is killed at a case.
        """
        begin = time.monotonic()
        for tries in range(1, self._limits.retries + 2):
            unable = self._start()
            if unable and self._killed and tries <= self._limits.retries:
                continue
            if unable:
                raise SmsHandoverError(f"a process for cases cannot start: {unable}")
            answer, status, cause = self._ask(json.dumps(task), self._limits.wall_time)
            if answer is not None:
                return self._done(answer, tries)
            if status is not Status.DIED:  # what takes too long or too much once does so again
                break
        row = Row(task, run_seed(self._seed, task.case), {}, status, cause, {}, "")
        return Done(row, Beside(0.0, time.monotonic() - begin, platform.node(), tries))

    def close(self) -> None:
        """End the child and all that it has started."""
        child, guard = self._child, self._guard
        self._child = self._guard = None
        if child is not None:
            with suppress(OSError):
                if child.stdin:
                    child.stdin.close()
            with suppress(subprocess.TimeoutExpired):
                child.wait(_END_S)
            end_session(child)
            child.wait()
            for stream in (child.stdout, child.stderr):
                if stream:
                    stream.close()
        if guard is not None:
            guard.close()
        if self._scratch is not None:
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._scratch = None

    def _start(self) -> str:
        """Start the child unless it runs; return why it cannot, '' if it can."""
        if self._child is not None and self._child.poll() is None:
            return ""
        self.close()
        self._pending, self._killed = b"", False
        try:
            # ours, as a child may be killed
            self._scratch = Path(tempfile.mkdtemp(prefix="sms_handover_cases_"))
            self._child = subprocess.Popen(
                self._program,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **_ONE_THREAD},
                start_new_session=True,  # Ctrl-C is for the parent, which ends it
            )
            self._guard = CaseGuard(self._child.pid, self._scratch)
        except OSError as error:
            self._kill()
            return str(error)
        answer, _, cause = self._ask(json.dumps({**self._first, "folder": str(self._scratch)}), _START_S)
        if answer is None:
            return cause
        if "error" in answer:
            raise ConfigurationError(str(answer["error"]))
        return ""

    def _ask(self, text: str, limit_s: float) -> tuple[dict[str, object] | None, Status, str]:
        """Send a line and wait for the answer; without one tell how and why that ended."""
        child = self._child
        assert child is not None and child.stdin and child.stdout and child.stderr
        self._said, streams = b"", [child.stdout, child.stderr]
        deadline = time.monotonic() + limit_s
        with suppress(OSError):  # a dead child has no answer either
            child.stdin.write(text.encode() + b"\n")
            child.stdin.flush()
        while b"\n" not in self._pending:
            has_ended = child.poll() is not None  # asked first, so that all of its answer is there by then
            ready = select(streams, [], [], _LOOK_S)[0]
            if child.stderr in ready:
                self._hear(child.stderr, streams)
            if child.stdout in ready:
                part = os.read(child.stdout.fileno(), _READ)
                if not part:
                    return None, Status.DIED, self._end_in_words()
                self._pending += part
            elif has_ended:  # what it has started may keep its output open
                return None, Status.DIED, self._end_in_words()
            elif time.monotonic() > deadline:
                self._kill()
                return None, Status.LIMIT, f"more than {limit_s:g} s of wall time"
            elif takes_more(child.pid, self._limits.memory):
                self._kill()
                return None, Status.LIMIT, f"more than {self._limits.memory:g} MB of memory (limits.memory)"
        line, _, self._pending = self._pending.partition(b"\n")
        answer: dict[str, object] = json.loads(line)
        return answer, Status.SUCCEEDED, ""

    def _hear(self, stream: IO[bytes], streams: list[IO[bytes]]) -> bool:
        """Take what the child says on standard error and keep its end; return whether it said any."""
        part = os.read(stream.fileno(), _READ)
        self._said = (self._said + part)[-_LONGEST_SAID:]
        if not part and stream in streams:
            streams.remove(stream)
        return bool(part)

    def _kill(self) -> None:
        """End the child and all that it has started at once."""
        if self._child is not None:
            end_session(self._child)
        self.close()

    def _end_in_words(self) -> str:
        """Return how the child ended, and the last line that it said."""
        child = self._child
        assert child is not None and child.stderr is not None
        while select([child.stderr], [], [], 0.0)[0] and self._hear(child.stderr, []):
            pass
        self.close()
        code, how = child.returncode, f"with exit code {child.returncode}"
        self._killed = code < 0
        if self._killed:
            with suppress(ValueError):
                how = f"by signal {signal.Signals(-code).name}"
        lines = [line for line in self._said.decode(errors="replace").splitlines() if line.strip()]
        said = f": {lines[-1].strip()}"[:_LONGEST_LINE] if lines else ""
        return f"its process ended {how}{said}"

    @staticmethod
    def _done(answer: dict[str, object], tries: int) -> Done:
        """Return a finished case from the answer of the child."""
        row, beside = row_of(json.loads(str(answer["row"]))), answer["beside"]
        assert isinstance(beside, dict)
        return Done(row, Beside(**{**beside, "tries": tries}), b64decode(str(answer.get("trajectory", ""))))
