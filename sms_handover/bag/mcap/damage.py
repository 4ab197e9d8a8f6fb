"""What is wrong at a place of a file, and how long a stretch of time it has cost."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from sms_handover.units import NS_PER_S


@dataclass(frozen=True)
class Damage:
    """Bytes ``begin`` to ``end`` of a file that cannot be used, and why.

    ``start_ns`` and ``end_ns`` are the log times of the messages that were there, None where nobody
    tells; ``messages`` counts them by topic, as far as an index tells. Damage ``of_index`` costs no
    message: the bytes only tell again what the rest of the file holds.
    """

    file: Path
    begin: int
    end: int
    reason: str
    start_ns: int | None = None
    end_ns: int | None = None
    messages: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    of_index: bool = False

    @property
    def size(self) -> int:
        """Return the number of bytes."""
        return self.end - self.begin

    def __str__(self) -> str:
        """Return the damage in words, with its place and, where known, what was there."""
        text = f"{self.file.name}: bytes {self.begin} to {self.end}: {self.reason}"
        if self.start_ns is not None and self.end_ns is not None:
            text += f" ({self.start_ns / NS_PER_S:.3f} to {self.end_ns / NS_PER_S:.3f} s)"
        if self.messages:
            text += f", {sum(self.messages.values())} messages"
        return text


class Hole:
    """Follows the log times of messages and the damage between them."""

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.newest_ns: int | None = None
        self._begin_ns: int | None = None  # of a hole that no message has ended yet
        self._open = False
        self._late_start_ns: int | None = None  # of the first message, if there is damage before it
        self._largest_ns = 0

    def message(self, log_time_ns: int) -> None:
        """Take the time of a message."""
        if self.newest_ns is None or self.first_ns is None:
            self.first_ns = self.newest_ns = log_time_ns
        if self._open:
            self._open = False
            if self._begin_ns is None:
                self._late_start_ns = log_time_ns
            else:
                self._largest_ns = max(self._largest_ns, log_time_ns - self._begin_ns)
        self.newest_ns = max(self.newest_ns, log_time_ns)
        self.first_ns = min(self.first_ns, log_time_ns)

    def damage(self, damage: Damage) -> None:
        """Take damage: it reaches from the newest message so far, or where it says itself, to the next."""
        if not self._open:
            self._open = True
            self._begin_ns = damage.start_ns if self.newest_ns is None else self.newest_ns
        if damage.start_ns is not None and damage.end_ns is not None:
            self._largest_ns = max(self._largest_ns, damage.end_ns - damage.start_ns)

    def largest(self, span: tuple[int, int] | None) -> tuple[int, bool]:
        """Return the longest stretch lost of a recording with this first and last log time.

        The second value tells whether the stretches at its ends are among them: not, if the damage
        reaches an end and the span of the recording is not known.
        """
        ends = []
        if self._late_start_ns is not None:
            ends.append(None if span is None else self._late_start_ns - span[0])
        if self._open:
            ends.append(None if span is None or self._begin_ns is None else span[1] - self._begin_ns)
        known = [end for end in ends if end is not None]
        return max(self._largest_ns, *known, 0), len(known) == len(ends)
