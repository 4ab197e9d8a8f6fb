"""Damage at a place of a file, and the interval of log time that it costs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from sms_handover.units import NS_PER_S


@dataclass(frozen=True)
class Damage:
    """Bytes ``begin`` to ``end`` of a file that cannot be used, and why.

    ``start_ns`` and ``end_ns`` are the log times of the messages that were there, None if unknown;
    ``messages`` counts them by topic, as far as an index does. Damage ``of_index`` costs no message:
    the bytes repeat what the rest of the file holds.
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
        text = f"{self.file.name}: bytes {self.begin} to {self.end}: {self.reason}"
        if self.start_ns is not None and self.end_ns is not None:
            text += f" ({self.start_ns / NS_PER_S:.3f} to {self.end_ns / NS_PER_S:.3f} s)"
        if self.messages:
            text += f", {sum(self.messages.values())} messages"
        return text


class Hole:
    """Measures the log time lost to damage between messages."""

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.latest_ns: int | None = None
        self._begin_ns: int | None = None  # of the open hole
        self._open = False
        self._late_start_ns: int | None = None  # of the first message, if damage precedes it
        self._largest_ns = 0

    def message(self, log_time_ns: int) -> None:
        """Take the time of a message."""
        if self.latest_ns is None or self.first_ns is None:
            self.first_ns = self.latest_ns = log_time_ns
        if self._open:
            self._open = False
            if self._begin_ns is None:
                self._late_start_ns = log_time_ns
            else:
                self._largest_ns = max(self._largest_ns, log_time_ns - self._begin_ns)
        self.latest_ns = max(self.latest_ns, log_time_ns)
        self.first_ns = min(self.first_ns, log_time_ns)

    def damage(self, damage: Damage) -> None:
        """Take damage: it spans from the latest message, or its own start, to the next message."""
        if not self._open:
            self._open = True
            self._begin_ns = damage.start_ns if self.latest_ns is None else self.latest_ns
        if damage.start_ns is not None and damage.end_ns is not None:
            self._largest_ns = max(self._largest_ns, damage.end_ns - damage.start_ns)

    def largest(self, span: tuple[int, int] | None) -> tuple[int, bool]:
        """Return the longest interval lost of a recording with this first and last log time.

        The second value is whether the intervals at its ends are included: not if damage reaches an
        end and the span of the recording is unknown.
        """
        ends = []
        if self._late_start_ns is not None:
            ends.append(None if span is None else self._late_start_ns - span[0])
        if self._open:
            ends.append(None if span is None or self._begin_ns is None else span[1] - self._begin_ns)
        known = [end for end in ends if end is not None]
        return max(self._largest_ns, *known, 0), len(known) == len(ends)
