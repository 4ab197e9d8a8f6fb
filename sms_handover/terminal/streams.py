"""Standard streams of a process: open, and able to take any text."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper

_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))  # by file descriptor


class _Forgiving(TextIOWrapper):
    """Standard error that ends no work because nobody can be told of it, as on a full disk."""

    def write(self, text: str) -> int:
        """Write what can be written."""
        with suppress(OSError):
            return super().write(text)
        return len(text)

    def flush(self) -> None:
        """Write out what can be written."""
        with suppress(OSError):
            super().flush()


def make_streams_safe() -> None:
    """Open what is closed of the standard streams to nowhere, and let output escape what it cannot encode.

    The next file that is opened would otherwise take the place of a closed stream, and whatever is printed
    would go into it.
    """
    for number, (name, mode) in enumerate(_STREAMS):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))
        if mode == "w":
            with suppress(AttributeError, ValueError):  # what a test or a caller has put in its place
                getattr(sys, name).reconfigure(errors="backslashreplace")
    if sys.stderr is sys.__stderr__:
        encoding = getattr(sys.stderr, "encoding", "utf-8")
        raw = os.fdopen(2, "wb", buffering=0, closefd=False)
        sys.stderr = _Forgiving(raw, encoding, "backslashreplace", line_buffering=True)


def let_go_of_failed_output() -> None:
    """Write out what was printed; what cannot be, as on a full disk or into a closed pipe, goes nowhere."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def printable(text: str) -> str:
    """Return a text of others, with escapes if it holds what does not belong in one line."""
    return text if text.isprintable() else ascii(text)
