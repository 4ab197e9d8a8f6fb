"""Task phase as CDR bytes; it changes a few times in a run, so its bytes are kept."""

from collections.abc import Collection
from dataclasses import replace

from rclpy.serialization import serialize_message
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

from sms_handover.errors import MessageError, Reason
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.template import head
from sms_handover.messages.values import task_phase
from sms_handover.ros.codecs.convert import phase_message
from sms_handover.ros.codecs.events import read_value
from sms_handover.ros.codecs.loop_messages import Stamped, arrival_ns
from sms_handover.types import GraspAction, TaskPhase

_STAMP_AT = 4  # [byte] behind the encapsulation
_BODY_AT = len(head(0))
_TYPE = "sms_handover_interfaces/msg/TaskPhase"


class PhaseCodec:
    """Packs and reads TaskPhase messages; all but the stamp is worked out once per phase."""

    def __init__(self, arms: Collection[str] = (), grasp_frames: Collection[str] = ()) -> None:
        """Take the names of robot and deputy that :meth:`checked` accepts."""
        self._arms, self._grasp_frames = frozenset(arms), frozenset(grasp_frames)
        self._types = MessageTypes()
        self._packed: tuple[TaskPhase, bytes] | None = None
        self._read: tuple[bytes, TaskPhase] | None = None

    def pack(self, phase: TaskPhase) -> bytes:
        """Return the bytes of a message."""
        if self._packed is None or not _alike(self._packed[0], phase):
            self._packed = phase, self._serialize(phase)
        return head(phase.stamp_ns) + self._packed[1]

    def read(self, data: bytes) -> TaskPhase:
        """Return the phase in the bytes of a message, of any sender; raises MessageError if it is none."""
        rest = data[:_STAMP_AT] + data[_BODY_AT:]
        if self._read is None or self._read[0] != rest:
            self._read = rest, read_value(data, TaskPhaseMessage, task_phase)
        return replace(self._read[1], stamp_ns=stamp_ns(data))

    def checked(self, data: bytes) -> Stamped[TaskPhase]:
        """Return stamp and phase of a message.

        Raises MessageError unless its grasp commands are for the robot and the deputy.
        """
        phase = self.read(data)
        for command in phase.commands:
            arms = {command.arm, command.from_arm} - {""}
            frames = {command.grasp_frame} - {""}
            unknown = (arms - self._arms) | (frames - self._grasp_frames)
            if unknown or not command.arm or not (frames or command.action is GraspAction.RELEASE):
                named = f"arm {command.arm!r} and grasp frame {command.grasp_frame!r}"
                text = f"a phase asks to {command.action.value} with {named}, which are not all known"
                raise MessageError(Reason.NAMES, text)
        return arrival_ns(data), phase

    def _serialize(self, phase: TaskPhase) -> bytes:
        """Return what follows the stamp in the bytes of a message.

        rclpy may put up to 8 bytes behind the end, which strict readers of bags reject.
        """
        data: bytes = serialize_message(phase_message(phase))
        end = len(self._types.serialize(self._types.deserialize(data, _TYPE)))
        return data[_BODY_AT:end]


def _alike(one: TaskPhase, other: TaskPhase) -> bool:
    """Whether two phases differ in nothing but their stamp."""
    return replace(one, stamp_ns=0) == replace(other, stamp_ns=0)
