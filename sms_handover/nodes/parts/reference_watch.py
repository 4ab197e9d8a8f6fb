"""Tells when the joint references stop coming, and when they come again."""

from sms_handover.graph.events import REFERENCE_BACK, REFERENCE_LOST, RunEvent, Severity
from sms_handover.graph.topics import CONTROLLER
from sms_handover.units import ns_to_seconds


class ReferenceWatch:
    """Compares the age of the last reference with what is tolerated."""

    def __init__(self, longest_ns: int) -> None:
        self._longest_ns = longest_ns
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._lost = False
        self._oldest_ns = 0

    def look(self, reference_ns: int, stamp_ns: int) -> RunEvent | None:
        """Return an event where the last reference has become too old, or is in time again."""
        age_ns = stamp_ns - reference_ns
        lost, oldest_ns = age_ns > self._longest_ns, self._oldest_ns
        self._oldest_ns = age_ns
        if lost is self._lost:
            return None
        self._lost = lost
        if lost:
            detail = "no joint reference in time; the desired joints stand still where the last one led"
            return self._event(REFERENCE_LOST, Severity.WARNING, detail, stamp_ns, age_ns)
        return self._event(REFERENCE_BACK, Severity.INFO, "joint references come again", stamp_ns, oldest_ns)

    def _event(self, kind: str, severity: Severity, detail: str, stamp_ns: int, age_ns: int) -> RunEvent:
        """Return an event with the age of the reference and what is tolerated."""
        longest_s = ns_to_seconds(self._longest_ns)
        return RunEvent(
            stamp_ns, CONTROLLER, kind, severity, detail, "", ns_to_seconds(age_ns), longest_s, "s"
        )
