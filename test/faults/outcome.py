"""What came of an injected fault."""

from dataclasses import dataclass
from enum import Enum


class PromiseBroken(Exception):
    """Something else happened than was promised; the text says what."""


class CannotTry(Exception):
    """This machine does not have what a fault takes; the text says what."""


def require(condition: object, instead: str) -> None:
    """Raise PromiseBroken with what was seen instead unless a condition holds."""
    if not condition:
        raise PromiseBroken(instead)


@dataclass(frozen=True)
class Loss:
    """What is lost of what had been published: messages, simulated time in ms; None where nobody knows."""

    messages: int | None = None
    ms: float | None = None

    def __str__(self) -> str:
        """Return it in words, '-' if nothing of it is known."""
        if (self.messages or 0, self.ms or 0.0) == (0, 0.0):
            return "-" if self.messages is None and self.ms is None else "nothing"
        parts = []
        if self.messages is not None:
            parts.append(f"{self.messages} messages")
        if self.ms is not None:
            parts.append(f"{self.ms:g} ms")
        return ", ".join(parts)


NOTHING_LOST = Loss(0, 0.0)


@dataclass(frozen=True)
class Kept:
    """A promise that was kept: exit code of the command, what was lost, and what is worth knowing."""

    exit_code: int | None = None
    lost: Loss = Loss()
    note: str = ""


class Status(Enum):
    """How an attempt ended."""

    KEPT = "kept"
    BROKEN = "BROKEN"
    NOT_TRIED = "not tried here"


@dataclass(frozen=True)
class Outcome:
    """One attempt; ``reason`` says what broke the promise or why it was not tried.

    ``shared_memory`` is in bytes, what was left in the fault's own /dev/shm, None where it has none.
    """

    fault: str
    status: Status
    reason: str = ""
    exit_code: int | None = None
    lost: Loss = Loss()
    note: str = ""
    shared_memory: int | None = None
    wall_s: float = 0.0
