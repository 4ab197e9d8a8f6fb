"""A line of text that tells how far something is: on a terminal written over, else now and then."""

import sys
from time import monotonic

_TERMINAL_PERIOD_S = 0.2  # [s] of wall time between two updates
_LOG_PERIOD_S = 5.0  # [s] of wall time between two lines where there is no terminal


class StatusLine:
    """One line on standard error."""

    def __init__(self) -> None:
        """Show nothing yet."""
        self._terminal = sys.stderr.isatty()
        self._period_s = _TERMINAL_PERIOD_S if self._terminal else _LOG_PERIOD_S
        self._next = 0.0
        self._width = 0

    @property
    def due(self) -> bool:
        """Tell whether it is time to show the line anew."""
        return monotonic() >= self._next

    def show(self, text: str) -> None:
        """Show the line."""
        self._next = monotonic() + self._period_s
        if not self._terminal:
            print(text, file=sys.stderr, flush=True)
            return
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)

    def stay(self) -> None:
        """Leave the line as it stands and go to the next."""
        if self._width:
            print(file=sys.stderr, flush=True)
        self._width = 0
