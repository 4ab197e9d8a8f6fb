"""How far a long look at a bag is: on a terminal in one line that is written over, else now and then."""

import sys
from time import monotonic

_TERMINAL_PERIOD_S = 0.2  # [s] of wall time between two updates
_LOG_PERIOD_S = 5.0  # [s] of wall time between two lines where there is no terminal, and before the first
_BYTES_PER_MB = 1e6


class ProgressLine:
    """Shows on standard error how many bytes have been gone through; use it as a context manager."""

    def __init__(self, what: str) -> None:
        """Say ``what`` is being done."""
        self._what = what
        self._terminal = sys.stderr.isatty()
        self._shown = monotonic()
        self._width = 0

    def __enter__(self) -> "ProgressLine":
        """Return the line."""
        return self

    def __exit__(self, *error: object) -> None:
        """Wipe the line off a terminal."""
        if self._width:
            print("\r" + " " * self._width + "\r", end="", file=sys.stderr, flush=True)

    def __call__(self, done: int, size: int) -> None:
        """Show ``done`` of ``size`` bytes, if the last update is old enough."""
        now = monotonic()
        if now - self._shown < (_TERMINAL_PERIOD_S if self._terminal else _LOG_PERIOD_S):
            return
        self._shown = now
        share = 100 * done / max(size, 1)
        text = f"{self._what}: {done / _BYTES_PER_MB:.1f} of {size / _BYTES_PER_MB:.1f} MB, {share:.0f} %"
        if self._terminal:
            print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
            self._width = len(text)
        else:
            print(text, file=sys.stderr, flush=True)
