"""A terminal with a Python program in it, as a user has one."""

import os
import pty
import select
import subprocess
import sys
import termios
from collections.abc import Callable
from time import monotonic
from types import TracebackType
from typing import Any

DEADLINE_S = 60.0  # s of wall time after which a test that waits has failed; nothing is measured by it

_TAKE_TERMINAL = "import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n"


class Terminal:
    """A new terminal, which is that of the program alone."""

    def __init__(self, program: str, **environment: str) -> None:
        """Start a program, given as Python text."""
        self._master, slave = pty.openpty()
        self._slave = slave
        self.found = self.settings
        self.process = subprocess.Popen(
            [sys.executable, "-c", _TAKE_TERMINAL + program],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env={**os.environ, **environment},
        )
        self.text = ""

    def __enter__(self) -> "Terminal":
        """Return the terminal."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the program."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._master)
        os.close(self._slave)

    @property
    def settings(self) -> list[Any]:
        """Return how the terminal is set."""
        return termios.tcgetattr(self._slave)

    @property
    def echoes(self) -> bool:
        """Whether keys are shown as they are pressed, as by default."""
        return bool(self.settings[3] & termios.ECHO)

    def press(self, keys: bytes) -> None:
        """Press keys."""
        os.write(self._master, keys)

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Read what is printed until a condition holds."""
        deadline = monotonic() + DEADLINE_S
        while not condition():
            assert monotonic() < deadline, f"waited in vain for {what}:\n{self.text}"
            if select.select([self._master], [], [], 0.02)[0]:
                self.text += os.read(self._master, 4096).decode(errors="replace")

    def until_text(self, text: str) -> None:
        """Wait until something has been printed."""
        self.until(lambda: text in self.text, repr(text))

    def end(self) -> int:
        """Wait for the end and return the exit code."""
        self.until(lambda: self.process.poll() is not None, "the end")
        return int(self.process.wait())
