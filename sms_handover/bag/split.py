"""Split of a recording into several files."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Split:
    """Maximum log time [ns] and size [byte] of a file, whichever comes first; 0 means no limit."""

    duration_ns: int = 0
    size: int = 0

    def due(self, duration_ns: int, size: int) -> bool:
        """Whether a file has reached a limit."""
        return 0 < self.duration_ns <= duration_ns or 0 < self.size <= size
