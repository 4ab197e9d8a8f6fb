"""When a recording goes on in a new file."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Split:
    """After so much log time in a file [ns], or so many bytes, whichever comes first; 0 is never."""

    duration_ns: int = 0
    size: int = 0

    def due(self, duration_ns: int, size: int) -> bool:
        """Whether a file with so much log time and so many bytes is at its end."""
        return 0 < self.duration_ns <= duration_ns or 0 < self.size <= size
