"""Events of a run: what nodes have decided or found, such as watchdogs, retried phases and exceeded limits.

``docs/watchdogs.md`` has the kinds of events and their causes. A kind is a plain word, so that a bag with
kinds of another version can be read.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from math import isnan, nan

from sms_handover.units import ns_to_seconds

COMMAND_LOST, TORQUE_ZERO, COMMAND_BACK = "command_lost", "torque_zero", "command_back"
REFERENCE_LOST, REFERENCE_BACK = "reference_lost", "reference_back"
NO_ANSWER = "no_answer"
RESYNCHRONISED = "resynchronised"
GRASP_MISSED, PHASE_RETRIED, GRASP_FAILED = "grasp_missed", "phase_retried", "grasp_failed"
IK_FAILED = "ik_failed"
COLLISION, TOUCH = "collision", "touch"
MESSAGE_REFUSED = "refused"
PLAN_FAILED, PLAN_BACK = "plan_failed", "plan_back"
POSITION_EXCEEDED, RATE_EXCEEDED = "position_exceeded", "rate_exceeded"


class Severity(Enum):
    """Severity of an event; the value is what a user reads."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True)
class RunEvent:
    """One decision of ``node`` at ``stamp_ns``, simulation time.

    ``value`` is the figure that it rests on and ``limit`` what is allowed of it, both in ``unit``; NaN
    where there is none. ``phase`` names the phase of the schedule, '' where the node knows of none.
    """

    stamp_ns: int
    node: str
    kind: str
    severity: Severity
    detail: str
    phase: str = ""
    value: float = nan
    limit: float = nan
    unit: str = ""

    def __str__(self) -> str:
        """Return the event in one line: time, severity, node, kind, detail and figures."""
        text = f"{ns_to_seconds(self.stamp_ns):6.2f} s  {self.severity.value} {self.kind} ({self.node})"
        figures = [f"{name} {value:g} {self.unit}".rstrip() for name, value in self._figures]
        return f"{text}: {'; '.join([self.detail, *figures])}"

    @property
    def _figures(self) -> list[tuple[str, float]]:
        figures = [("value", self.value), ("limit", self.limit)]
        return [(name, value) for name, value in figures if not isnan(value)]


def graver_in_words(events: Iterable[RunEvent]) -> str:
    """Return how many errors and warnings there are among events, '' if there are none."""
    severities = [event.severity for event in events]
    counts = [(severities.count(severity), severity.value) for severity in (Severity.ERROR, Severity.WARNING)]
    return ", ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)
