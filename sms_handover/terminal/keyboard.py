"""Keys from a terminal without waiting for Enter; the terminal is always left as it was found."""

import os
import select
import signal
import sys
import termios
import tty
from contextlib import AbstractContextManager, suppress
from enum import Enum
from types import FrameType, TracebackType
from typing import Any


class Key(Enum):
    """The keys that a playback knows, by what a terminal sends for them."""

    SPACE = b" "
    UP = b"\x1b[A"
    DOWN = b"\x1b[B"
    RIGHT = b"\x1b[C"


_APPLICATION_MODE = (b"\x1bO", b"\x1b[")  # some terminals send ESC O A instead of ESC [ A
_MOST = 256  # [byte] read at once


class Keyboard(AbstractContextManager["Keyboard"]):
    """The keys pressed on standard input; none if that is no terminal, or not ours to read.

    While it is entered the terminal hands over single keys and does not echo them. It is put back on
    leaving, whatever happened in between, and while the process is stopped (Ctrl-Z).
    """

    def __init__(self, *, wanted: bool = True) -> None:
        """Look at standard input; nothing is changed yet."""
        self._found: list[Any] | None = None
        self._stop_handler: Any = None
        self._fd = _terminal() if wanted else None

    @property
    def usable(self) -> bool:
        """Whether there are keys at all."""
        return self._fd is not None

    def __enter__(self) -> "Keyboard":
        """Take single keys from now on."""
        if self._fd is not None:
            self._take()
            self._stop_handler = signal.signal(signal.SIGTSTP, self._on_stop)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._stop_handler is not None:
            signal.signal(signal.SIGTSTP, self._stop_handler)
        self._give_back()

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
        """Return the bytes that wait; none in the background, and never any once the terminal is gone."""
        if self._fd is None or _terminal() is None:
            return b""
        if self._found is None:  # stopped, then continued in the background, and in the foreground again
            self._take()
        if not select.select([self._fd], [], [], 0)[0]:
            return b""
        try:
            data = os.read(self._fd, _MOST)
        except OSError:
            data = b""
        if not data:
            self._fd = None
        return data.replace(*_APPLICATION_MODE)

    def _take(self) -> None:
        """Have the terminal hand over single keys."""
        if self._fd is not None:
            self._found = termios.tcgetattr(self._fd)
            tty.setcbreak(self._fd, termios.TCSANOW)

    def _give_back(self) -> None:
        """Put the terminal back as it was found."""
        if self._found is not None:
            with suppress(termios.error):  # it may be gone
                termios.tcsetattr(sys.stdin.fileno(), termios.TCSANOW, self._found)
            self._found = None

    def _on_stop(self, number: int, frame: FrameType | None) -> None:
        """Stop as Ctrl-Z asks, with the terminal as it was; take it again when the process goes on."""
        self._give_back()
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
