"""A terminal with a Python program in it, as a user has one."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Callable
from time import monotonic
from types import TracebackType
from typing import Any

DEADLINE_S = 60.0  # s of wall time after which a test that waits has failed; nothing is measured by it

_CODE = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])|(.)", re.DOTALL)
# A login shell's child has its signals; one of a background job has SIGINT and, under nohup, SIGHUP ignored.
_TAKE_TERMINAL = (
    "import fcntl, signal, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n"
    "signal.signal(signal.SIGINT, signal.default_int_handler); signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
)


def _inherited() -> dict[str, str]:
    """Return the environment without what would tell a program of another terminal's size."""
    return {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}


class Terminal:
    """A new terminal, which is that of the program alone."""

    def __init__(self, program: str, columns: int = 80, **environment: str) -> None:
        """Start a program, given as Python text."""
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 24, columns, 0, 0))
        self._columns = columns
        self._slave = slave
        self.found = self.settings
        self.process = subprocess.Popen(
            [sys.executable, "-c", _TAKE_TERMINAL + program],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env={**_inherited(), **environment},
        )
        self.text, self._closed = "", False

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
        if not self._closed:
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

    @property
    def screen(self) -> list[str]:
        """Return the lines that have been printed as they look now, wrapped where they are too wide."""
        lines, row, column = [""], 0, 0
        for number, code, character in _CODE.findall(self.text):
            if code == "A":
                row -= int(number or 1)
            elif (code, number) == ("K", "2"):
                lines[row] = ""
            elif character == "\r":
                column = 0
            elif character == "\n" or (character and column == self._columns):
                row, column = row + 1, 0
                lines += [""] * (row + 1 - len(lines))
            if character and character not in "\r\n":
                line = lines[row].ljust(column)
                lines[row] = line[:column] + character + line[column + 1 :]
                column += 1
        return [line.rstrip() for line in lines]

    def hang_up(self) -> None:
        """Close the terminal while the program goes on."""
        os.close(self._slave)
        os.close(self._master)
        self._closed = True

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
