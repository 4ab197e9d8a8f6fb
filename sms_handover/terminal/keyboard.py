"""Keyboard: keys from a terminal without waiting for Enter; its settings are always restored."""

import os
import select
import signal
import sys
import termios
import tty
from contextlib import suppress
from enum import Enum
from types import FrameType
from typing import Any


class Key(Enum):
    """The keys that a playback knows, by what a terminal sends for them."""

    SPACE = b" "
    UP = b"\x1b[A"
    DOWN = b"\x1b[B"
    RIGHT = b"\x1b[C"


_APPLICATION_MODE = (b"\x1bO", b"\x1b[")  # some terminals send ESC O A instead of ESC [ A
_READ_SIZE = 256  # [byte]


class Keyboard:
    """The keys pressed on standard input; none if it is no terminal or another process group owns it.

    Within the context the terminal delivers single keys and does not echo them. Its settings are restored
    on leaving, whatever happened in between, and while the process is stopped (Ctrl-Z).
    """

    def __init__(self, *, wanted: bool = True) -> None:
        self._found: list[Any] | None = None
        self._stop_handler: Any = None
        self._fd = _terminal() if wanted else None

    @property
    def usable(self) -> bool:
        """Whether there are keys at all."""
        return self._fd is not None

    def __enter__(self) -> "Keyboard":
        if self._fd is not None:
            self._set_up()
            self._stop_handler = signal.signal(signal.SIGTSTP, self._on_stop)
        return self

    def __exit__(self, *error: object) -> None:
        if self._stop_handler is not None:
            signal.signal(signal.SIGTSTP, self._stop_handler)
        self._restore()

    def pressed(self) -> list[Key]:
        """Return the keys pressed since the last call."""
        keys = []
        data = self._read()
        while data:
            key = next((key for key in Key if data.startswith(key.value)), None)
            if key is not None:
                keys.append(key)
            data = data[len(key.value) if key else 1 :]
        return keys

    def _read(self) -> bytes:
        """Return the pending bytes; none in the background or after the terminal was closed."""
        if self._fd is None or _terminal() is None:
            return b""
        if self._found is None:  # stopped, then continued in the background, and in the foreground again
            self._set_up()
        if not select.select([self._fd], [], [], 0)[0]:
            return b""
        try:
            data = os.read(self._fd, _READ_SIZE)
        except OSError:
            data = b""
        if not data:
            self._fd = None
        return data.replace(*_APPLICATION_MODE)

    def _set_up(self) -> None:
        if self._fd is not None:
            self._found = termios.tcgetattr(self._fd)
            tty.setcbreak(self._fd, termios.TCSANOW)

    def _restore(self) -> None:
        if self._found is not None:
            with suppress(termios.error):  # it may be gone
                termios.tcsetattr(sys.stdin.fileno(), termios.TCSANOW, self._found)
            self._found = None

    def _on_stop(self, number: int, frame: FrameType | None) -> None:
        """Stop as Ctrl-Z asks, with the terminal restored; set it up again when the process continues."""
        self._restore()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._on_stop)


def _terminal() -> int | None:
    """Return the descriptor of standard input if it is a terminal that this process may read."""
    try:
        fd = sys.stdin.fileno()
        return fd if os.isatty(fd) and os.tcgetpgrp(fd) == os.getpgrp() else None
    except (OSError, ValueError, AttributeError):
        return None
