"""Progress of long work on standard error: a live line on a terminal, else a plain line now and then."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import TypeVar

_TERMINAL_PERIOD_S = 0.2  # [s] of wall time between two updates
_LOG_PERIOD_S = 5.0  # [s] of wall time between two lines where there is no terminal
_SHORT_S = 1.0  # [s] of wall time; shorter work needs no line
_BYTES_PER_MB = 1e6

T = TypeVar("T", bound="Progress")


class Progress:
    """Shows how far something is; a terminal or pipe that was closed never ends the work."""

    def __init__(self, after_s: float = 0.0) -> None:
        """Show nothing until ``after_s`` [s] of wall time have passed."""
        self._live = None
        if sys.stderr.isatty():
            # rich takes time to import, and only a terminal needs it
            from sms_handover.terminal.live_line import LiveLine  # noqa: PLC0415

            line = LiveLine()
            self._live = line if line.usable else None
        self._period_s = _TERMINAL_PERIOD_S if self._live else _LOG_PERIOD_S
        self._next_s = monotonic() + after_s

    def __enter__(self: T) -> T:
        return self

    def __exit__(self, *error: object) -> None:
        self.stay()

    @property
    def due(self) -> bool:
        """Whether it is time to show something again."""
        return monotonic() >= self._next_s

    def show(self, text: str, details: str = "", share: float | None = None) -> None:
        """Show a text, details that a narrow terminal cuts off, and a bar for a share in [0, 1]."""
        self._next_s = monotonic() + self._period_s
        if self._live:
            self._live.show(text, details, share)
        else:
            self.print(f"{text}  {details}".rstrip())

    def print(self, *lines: str) -> None:
        """Print lines that stay."""
        for line in lines:
            with suppress(OSError):
                if self._live:
                    self._live.print(line)
                else:
                    print(line, file=sys.stderr, flush=True)

    def stay(self) -> None:
        """Leave what is shown as it is, and go to the next line."""
        if self._live:
            self._live.stay()


@contextmanager
def byte_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a callback that shows the bytes done and their total, if the work takes more than a second."""
    with Progress(after_s=_SHORT_S) as progress:

        def show(done: int, size: int) -> None:
            if progress.due:
                share = done / max(size, 1)
                megabytes = f"{done / _BYTES_PER_MB:.1f} of {size / _BYTES_PER_MB:.1f} MB"
                progress.show(what, f"{megabytes}, {100 * share:.0f} %", share)

        yield show
