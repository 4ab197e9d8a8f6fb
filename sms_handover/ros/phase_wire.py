"""The phase of the task as CDR bytes; it changes a few times in a run, so its bytes are kept."""

import struct
from dataclasses import replace

from rclpy.serialization import deserialize_message, serialize_message
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

from sms_handover.bag.decode import task_phase
from sms_handover.bag.message_types import MessageTypes
from sms_handover.bag.stamp import stamp_ns
from sms_handover.ros.convert import phase_message
from sms_handover.types import TaskPhase
from sms_handover.units import NS_PER_S

_STAMP = struct.Struct("<iI")  # seconds, nanoseconds
_HEAD = b"\x00\x01\x00\x00"  # encapsulation of plain little-endian CDR
_BODY_AT = len(_HEAD) + _STAMP.size
_TYPE = "sms_handover_interfaces/msg/TaskPhase"


class PhaseWire:
    """Packs and reads TaskPhase messages; all but the stamp is worked out once per phase."""

    def __init__(self) -> None:
        """Know the type of the message."""
        self._types = MessageTypes()
        self._packed: tuple[TaskPhase, bytes] | None = None
        self._read: tuple[bytes, TaskPhase] | None = None

    def pack(self, phase: TaskPhase) -> bytes:
        """Return the bytes of a message."""
        if self._packed is None or not _alike(self._packed[0], phase):
            self._packed = phase, self._serialize(phase)
        stamp = _STAMP.pack(phase.stamp_ns // NS_PER_S, phase.stamp_ns % NS_PER_S)
        return _HEAD + stamp + self._packed[1]

    def read(self, data: bytes) -> TaskPhase:
        """Return the phase in the bytes of a message, of any sender."""
        rest = data[: len(_HEAD)] + data[_BODY_AT:]
        if self._read is None or self._read[0] != rest:
            self._read = rest, task_phase(deserialize_message(data, TaskPhaseMessage))
        return replace(self._read[1], stamp_ns=stamp_ns(data))

    def _serialize(self, phase: TaskPhase) -> bytes:
        """Return what follows the stamp in the bytes of a message.

        rclpy may put up to 8 bytes behind the end, which strict readers of bags refuse.
        """
        data: bytes = serialize_message(phase_message(phase))
        end = len(self._types.serialize(self._types.deserialize(data, _TYPE)))
        return data[_BODY_AT:end]


def _alike(one: TaskPhase, other: TaskPhase) -> bool:
    """Tell whether two phases differ in nothing but their stamp."""
    return replace(one, stamp_ns=0) == replace(other, stamp_ns=0)
