"""Event messages of any publisher as values."""

from collections.abc import Callable
from typing import Any, TypeVar

from sms_handover_interfaces.msg import Clearance as ClearanceMessage
from sms_handover_interfaces.msg import GraspEvent as GraspEventMessage
from sms_handover_interfaces.msg import RunEvent as RunEventMessage

from sms_handover.errors import MessageError, Reason
from sms_handover.graph.events import RunEvent
from sms_handover.messages.values import collisions, grasp_event, run_event
from sms_handover.ros.codecs.loop_messages import decoded
from sms_handover.types import Collision, GraspEvent

V = TypeVar("V")


def read_grasp_event(data: bytes) -> GraspEvent:
    """Return the event of a GraspEvent message; raises MessageError."""
    return read_value(data, GraspEventMessage, grasp_event)


def read_run_event(data: bytes) -> RunEvent:
    """Return the event of a RunEvent message; raises MessageError."""
    return read_value(data, RunEventMessage, run_event)


def read_collisions(data: bytes) -> tuple[Collision, ...]:
    """Return the groups of bodies of a Clearance message that collide; raises MessageError."""
    return read_value(data, ClearanceMessage, collisions)


def read_value(data: bytes, kind: Any, value: Callable[[Any], V]) -> V:
    """Return the value of a message; raises MessageError on a number without a meaning."""
    try:
        return value(decoded(data, kind))
    except KeyError as error:
        text = f"a {kind.__name__} has an unknown action, state, status or severity"
        raise MessageError(Reason.NAMES, text) from error
