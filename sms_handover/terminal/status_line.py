"""A line of text that tells how far something is: on a terminal written over, else now and then."""

import sys
from contextlib import suppress
from time import monotonic

_TERMINAL_PERIOD_S = 0.2  # [s] of wall time between two updates
_LOG_PERIOD_S = 5.0  # [s] of wall time between two lines where there is no terminal


class StatusLine:
    """One line on standard error."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._period_s = _TERMINAL_PERIOD_S if self._terminal else _LOG_PERIOD_S
        self._next = 0.0
        self._width = 0

    @property
    def due(self) -> bool:
        """Whether it is time to show the line anew."""
        return monotonic() >= self._next

    def show(self, text: str) -> None:
        """Show the line."""
        self._next = monotonic() + self._period_s
        if not self._terminal:
            _print(f"{text}\n")
            return
        _print("\r" + text.ljust(self._width))
        self._width = len(text)

    def stay(self) -> None:
        """Leave the line as it stands and go to the next."""
        if self._width:
            _print("\n")
        self._width = 0


def _print(text: str) -> None:
    """Print a text, unless the terminal was closed: work does not end for want of a spectator."""
    with suppress(OSError):
        print(text, end="", file=sys.stderr, flush=True)
