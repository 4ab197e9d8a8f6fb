"""The surroundings of one attempt: its folder, domain, random numbers, and the commands that it starts."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from ..system.runs import DEADLINE_S, Ended, Running, command_of, has_ended
from .leftovers import GRACE_S, MARK, end_all, of_trial
from .outcome import CannotTry, require


@dataclass(frozen=True)
class Trial:
    """What one attempt works with; nothing of it is shared with another."""

    folder: Path
    domain: int
    random: Random
    mark: str
    own_mounts: bool

    @property
    def is_root(self) -> bool:
        """Whether permissions do not hold for this process."""
        return os.geteuid() == 0

    def environment(self, more: Mapping[str, str] | None = None) -> dict[str, str]:
        """Return the environment of a process of this trial."""
        return {**os.environ, MARK: self.mark, "ROS_DOMAIN_ID": str(self.domain), **(more or {})}

    def sms_handover(
        self,
        *arguments: object,
        prefix: Sequence[object] = (),
        environment: Mapping[str, str] | None = None,
        timeout_s: float = DEADLINE_S,
    ) -> Ended:
        """Carry out a command to its end, behind a ``prefix`` such as ``("prlimit", "--nofile=64")``."""
        return self.command([*prefix, *command_of(arguments)], environment=environment, timeout_s=timeout_s)

    def command(
        self,
        command: Sequence[object],
        *,
        environment: Mapping[str, str] | None = None,
        timeout_s: float = DEADLINE_S,
    ) -> Ended:
        """Carry out any command to its end in the folder of the trial."""
        done = subprocess.run(
            [str(word) for word in command],
            cwd=self.folder,
            env=self.environment(environment),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout_s,
            check=False,
            start_new_session=True,
        )
        return Ended(done.returncode, done.stdout, done.stderr)

    @contextmanager
    def start(
        self,
        *arguments: object,
        module: str = "",
        prefix: Sequence[object] = (),
        environment: Mapping[str, str] | None = None,
    ) -> Iterator[Running]:
        """Start a command, or the ``module`` of a node, in a session of its own; see Running.

        What it prints goes to a file, ``Running.text``. A command that still runs at the end is killed;
        nodes that it has left behind are not: they are found, and break the promise.
        """
        words = [sys.executable, "-m", module, *arguments] if module else command_of(arguments)
        log = self.folder / f"printed_{len(list(self.folder.glob('printed_*')))}"
        with log.open("w", encoding="utf-8") as stream:
            process = subprocess.Popen(
                [str(word) for word in (*prefix, *words)],
                cwd=self.folder,
                env=self.environment(environment),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
            )
        try:
            yield Running(process, log)
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()

    def ended(self, run: Running) -> Ended:
        """Wait for the end of a command and return how it ended; ``out`` and ``err`` are all it printed."""
        code = run.end()
        return Ended(code, run.text, run.text)

    def mount(self, place: Path, *, size: str = "", inodes: int = 0, read_only: bool = False) -> None:
        """Put a small file system (tmpfs) on a folder, which is made; it goes away with the trial.

        ``size`` is as in mount(8), e.g. ``"300k"``. Raises CannotTry where that is not allowed.
        """
        if not self.own_mounts:
            raise CannotTry("no mounts of its own: not root, and no user namespaces")
        place.mkdir(parents=True, exist_ok=True)
        options = [f"size={size}"] if size else []
        options += [f"nr_inodes={inodes}"] if inodes else []
        options += ["ro"] if read_only else []
        done = self.command(["mount", "-t", "tmpfs", "-o", ",".join(options) or "rw", "tmpfs", place])
        if done.code:
            raise CannotTry(f"mount: {done.err.strip()}")

    def remaining(self) -> dict[int, str]:
        """Return the processes of this trial other than this one, by id, with their command lines."""
        return of_trial(self.mark, without=os.getpid())

    def wait_for(self, pid: int) -> None:
        """Wait for the end of a process; raises PromiseBroken if it does not come."""
        require(has_ended(pid, GRACE_S), f"process {pid} does not end")

    def end_remaining(self) -> None:
        """Kill the processes of this trial, for a fault after which nothing else would."""
        end_all(self.remaining())
