"""Diagnostics of a node, as REP 107 has them: a level, a text, and values by key.

A status is called as diagnostic_updater would call it: node with namespace, colon, what it reports on.
Levels are OK, and WARN for a node that waits or has rejected a message; a node that fails ends and is stale.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from sms_handover.ros.codecs.convert import time_message

_TASK = ": loop"
_REJECTED = "refused "  # begins the keys that count rejected messages


@dataclass(frozen=True)
class NodeReport:
    """What a node says of itself: simulation time in ns, values, a level, and a text ("" if all is well)."""

    stamp_ns: int = 0
    values: Mapping[str, object] = field(default_factory=dict)
    level: int = 0  # [-] as in DiagnosticStatus
    text: str = ""


def node_of(status: str) -> str:
    """Return the node that reports under the name of a status."""
    return status.partition(":")[0]


def diagnostics_message(
    name: str, report: NodeReport, *, wakes: int, waiting: Sequence[str], rejected: Mapping[str, int]
) -> DiagnosticArray:
    """Return the diagnostics of a node; what it waits for goes before its own text, that before rejections.

    ``name`` is the node's with its namespace.

    ``wakes`` of its loop, and how many messages were ``rejected`` by topic and reason, are values too.
    """
    level, text = report.level, report.text
    if rejected and not level:
        level, text = 1, f"rejected {', '.join(f'{kind} ({count})' for kind, count in rejected.items())}"
    values = {**report.values, "wakes": wakes}
    values.update((_REJECTED + kind, count) for kind, count in rejected.items())
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN if waiting else bytes([level]),
        name=f"{name.lstrip('/')}{_TASK}",
        hardware_id="none",
        message="waiting for " + ", ".join(waiting) if waiting else text or "running",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = time_message(report.stamp_ns)
    return message
