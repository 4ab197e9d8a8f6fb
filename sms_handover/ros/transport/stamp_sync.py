"""Stamp synchronisation: inputs of equal stamp are brought together, in whatever order they arrive."""

from time import monotonic_ns
from typing import Generic, TypeVar

from sms_handover.errors import MessageError, Reason
from sms_handover.units import ns_to_seconds

V = TypeVar("V")

_LONGEST = 64  # [stamps] waiting at most by default; more means that an input has stopped


class StampOrder:
    """The stamps of an input that is used as it comes: each newer than the last, none from the future."""

    def __init__(self, ahead_ns: int) -> None:
        """Start before time zero; a stamp further than ``ahead_ns`` ahead of the run is from the future."""
        self._ahead_ns = ahead_ns
        self._latest_ns = -1

    def reset(self) -> None:
        """Start before time zero again."""
        self._latest_ns = -1

    def accept(self, stamp_ns: int, now_ns: int) -> None:
        """Note a stamp; raises MessageError if it is not newer, or ahead of a run that is at ``now_ns``."""
        if stamp_ns <= self._latest_ns:
            reason = Reason.DUPLICATE if stamp_ns == self._latest_ns else Reason.OLD
            latest = f"the latest one has {ns_to_seconds(self._latest_ns):g} s"
            raise MessageError(reason, f"stamped {ns_to_seconds(stamp_ns):g} s, but {latest}")
        if stamp_ns - now_ns > self._ahead_ns:
            now = f"the run is at {ns_to_seconds(now_ns):g} s"
            raise MessageError(Reason.FUTURE, f"stamped {ns_to_seconds(stamp_ns):g} s, but {now}")
        self._latest_ns = stamp_ns


class StampSync(Generic[V]):
    """Keeps inputs until all that belong to one stamp are there.

    Inputs have names. Those whose stamp is not newer than the last one taken are rejected and counted.
    """

    def __init__(self, longest: int = _LONGEST, *, ahead_ns: int | None = None, paced: bool = False) -> None:
        """Start empty; at most ``longest`` stamps wait, then the oldest is given up.

        A stamp further than ``ahead_ns`` ahead of the last one taken is from the future. If the run is
        ``paced`` by the wall clock, it may go on by as much as that has.
        """
        self._longest = longest
        self._ahead_ns = ahead_ns
        self._paced = paced
        self._waiting: dict[int, dict[str, V]] = {}
        self._taken_ns = -1
        self._taken_at_ns = monotonic_ns()
        self._begun: set[str] | None = None
        self.dropped = 0

    def restarts_run(self, stamp_ns: int) -> bool:
        """Whether a stamp is the start of a run after inputs of a later time were taken.

        The start right after the start is the same state resent, to which the same answer belongs.
        """
        return stamp_ns == 0 and self._taken_ns > 0

    def reset(self) -> None:
        """Forget everything, as at the start of a run."""
        self._waiting.clear()
        self._taken_ns = -1

    def reset_run(self) -> None:
        """Start a run after another: of each input, what comes before its time zero is still of the other.

        Each input keeps its own order, so nothing of the other run gets into the new one.
        """
        self.reset()
        self._begun = set()
        self.dropped = 0

    def admits(self, stamp_ns: int, name: str) -> bool:
        """Whether an input belongs to this run, and not to the one before."""
        if self._begun is None or name in self._begun:
            return True
        if stamp_ns == 0:
            self._begun.add(name)
        return stamp_ns == 0

    def add(self, stamp_ns: int, name: str, value: V) -> None:
        """Keep an input; raises MessageError if its stamp is not one of those to come.

        What is left over from the run before is dropped and counted without an error.
        """
        if self._begun is not None and not self.admits(stamp_ns, name):
            self.dropped += 1
            return
        if stamp_ns <= self._taken_ns:
            self.dropped += 1
            taken = f"{ns_to_seconds(self._taken_ns):g} s has been worked on"
            if stamp_ns == self._taken_ns:
                raise MessageError(Reason.DUPLICATE, f"the stamp of {taken} already")
            raise MessageError(Reason.OLD, f"stamped {ns_to_seconds(stamp_ns):g} s, but {taken}")
        if self._ahead_ns is not None and stamp_ns - max(self._taken_ns, 0) > self._ahead_ns:
            self._reject_future(stamp_ns, self._ahead_ns)
        self._waiting.setdefault(stamp_ns, {})[name] = value
        if len(self._waiting) > self._longest:
            self.dropped += len(self._waiting.pop(min(self._waiting)))

    def _reject_future(self, stamp_ns: int, ahead_ns: int) -> None:
        """Raise MessageError if a stamp is further ahead than a run can have come."""
        known_ns = max(self._taken_ns, 0) + (monotonic_ns() - self._taken_at_ns if self._paced else 0)
        if stamp_ns - known_ns > ahead_ns:
            raise MessageError(
                Reason.FUTURE,
                f"stamped {ns_to_seconds(stamp_ns):g} s, but the run has come to "
                f"{ns_to_seconds(max(self._taken_ns, 0)):g} s",
            )

    @property
    def oldest_ns(self) -> int | None:
        """The oldest stamp of which an input waits, None if none does."""
        return min(self._waiting) if self._waiting else None

    def missing(self, stamp_ns: int, names: tuple[str, ...]) -> str:
        """Return the last of the names whose input of a stamp is missing, "" if none is."""
        inputs = self._waiting.get(stamp_ns, ())
        for name in reversed(names):
            if name not in inputs:
                return name
        return ""

    def take(self, stamp_ns: int, names: tuple[str, ...]) -> dict[str, V] | None:
        """Return the inputs of a stamp if all the named ones are there, else None."""
        inputs = self._waiting.get(stamp_ns)
        if inputs is None or len(inputs) < len(names):
            return None
        for name in names:
            if name not in inputs:
                return None
        self._taken_ns = stamp_ns
        if self._paced:
            self._taken_at_ns = monotonic_ns()
        if len(self._waiting) == 1:
            self._waiting.clear()
            return inputs
        for old in [stamp for stamp in self._waiting if stamp <= stamp_ns]:
            del self._waiting[old]
        return inputs
