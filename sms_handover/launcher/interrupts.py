"""Interrupts: signals that ask for the end of a run, and output whose reader has ended."""

import os
import select
import signal
from typing import Any

_ALL = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_OUTPUTS = (1, 2)  # file descriptors of standard output and standard error


class Interrupts:
    """Counts the signals: the first asks for an orderly end, a second one, or SIGQUIT, for one at once.

    A context manager: before and after it signals do what they did.
    """

    def __init__(self) -> None:
        self._count = self._reported = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "Interrupts":
        """Install the handlers; a hang-up that is ignored, as under nohup(1), stays ignored."""
        for number in _ALL:
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *reason: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @property
    def asked(self) -> bool:
        """Whether the run is to end."""
        return self._count > 0

    @property
    def at_once(self) -> bool:
        """Whether nothing is to be waited for."""
        return self._count > 1

    def heed(self) -> None:
        """Raise KeyboardInterrupt if the run is to end: there is nothing yet to be ended in order."""
        if self.asked:
            raise KeyboardInterrupt

    def poll(self) -> list[str]:
        """Return a line for the user if there was an interrupt since the last call."""
        new = self._reported < self._count
        self._reported = self._count
        return ["ending the run; once more to end it at once"] if new else []

    def _on_signal(self, number: int, frame: object) -> None:
        self._count += 2 if number == signal.SIGQUIT else 1


def let_go_of_closed_output() -> None:
    """Redirect output to /dev/null where its terminal or pipe was closed: the run goes on without it."""
    for output in _OUTPUTS:
        poll = select.poll()
        poll.register(output, select.POLLOUT)
        if any(event & (select.POLLHUP | select.POLLERR) for _, event in poll.poll(0)):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, output)
            os.close(nowhere)
