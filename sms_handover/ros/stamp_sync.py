"""Brings together inputs of equal stamp, whatever order they arrive in."""

from typing import Generic, TypeVar

V = TypeVar("V")

_LONGEST = 64  # [stamps] waiting at most by default; more means that an input has stopped


class StampSync(Generic[V]):
    """Keeps inputs until all that belong to one stamp are there.

    Inputs have names. Stamps older than the last one taken are dropped and counted.
    """

    def __init__(self, longest: int = _LONGEST) -> None:
        """Start empty; at most ``longest`` stamps wait, then the oldest is given up."""
        self._longest = longest
        self._waiting: dict[int, dict[str, V]] = {}
        self._taken_ns = -1
        self.dropped = 0

    def begins_anew(self, stamp_ns: int) -> bool:
        """Tell whether a stamp is the start of a run behind inputs taken of a later time.

        The start behind the start alone is the same state once more, to which the same answer belongs.
        """
        return stamp_ns == 0 and self._taken_ns > 0

    def reset(self) -> None:
        """Forget everything, as at the start of a run."""
        self._waiting.clear()
        self._taken_ns = -1

    def add(self, stamp_ns: int, name: str, value: V) -> None:
        """Keep an input."""
        if stamp_ns <= self._taken_ns:
            self.dropped += 1
            return
        self._waiting.setdefault(stamp_ns, {})[name] = value
        if len(self._waiting) > self._longest:
            self.dropped += len(self._waiting.pop(min(self._waiting)))

    @property
    def oldest_ns(self) -> int | None:
        """Return the oldest stamp of which something waits, None if nothing does."""
        return min(self._waiting) if self._waiting else None

    def missing(self, stamp_ns: int, names: tuple[str, ...]) -> str:
        """Return the last of the names of which nothing is there for a stamp, "" if there is none."""
        inputs = self._waiting.get(stamp_ns, {})
        return next((name for name in reversed(names) if name not in inputs), "")

    def take(self, stamp_ns: int, names: tuple[str, ...]) -> dict[str, V] | None:
        """Return the inputs of a stamp if all the named ones are there, else None."""
        inputs = self._waiting.get(stamp_ns)
        if inputs is None or not inputs.keys() >= set(names):
            return None
        self._taken_ns = stamp_ns
        if len(self._waiting) == 1:
            self._waiting.clear()
            return inputs
        for old in [stamp for stamp in self._waiting if stamp <= stamp_ns]:
            del self._waiting[old]
        return inputs
