"""Tells when a loop in lock step has stood still for too long."""

from sms_handover.graph.events import NO_ANSWER, RunEvent, Severity
from sms_handover.graph.topics import PLANT
from sms_handover.plant.parameters import PlantParameters
from sms_handover.units import ns_to_seconds


class AnswerWatch:
    """Notes for how long a state has had no answer; an ``answer_timeout`` of 0 tolerates any time."""

    def __init__(self, parameters: PlantParameters) -> None:
        """Begin with a loop that goes on."""
        self._timeout_s = parameters.answer_timeout
        self._stamp_ns: int | None = None
        self._since_s = 0.0

    def look(self, stamp_ns: int | None, awaited: str, now_s: float) -> RunEvent | None:
        """Return an event if the state of a stamp has waited for the input ``awaited`` for too long.

        ``stamp_ns`` is None while the loop is not meant to go on; ``now_s`` is wall time.
        """
        if stamp_ns != self._stamp_ns:
            self._stamp_ns, self._since_s = stamp_ns, now_s
        silent_s = now_s - self._since_s
        if stamp_ns is None or not 0.0 < self._timeout_s <= silent_s:
            return None
        detail = f"nothing has come on {awaited} for the state of {ns_to_seconds(stamp_ns):g} s"
        return RunEvent(
            stamp_ns,
            PLANT,
            NO_ANSWER,
            Severity.ERROR,
            detail,
            "",
            silent_s,
            self._timeout_s,
            "s of wall time",
        )
