"""Phases keep every field through the codec, and other senders' bytes are read as well."""

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.values import task_phase
from sms_handover.ros.codecs.convert import phase_message
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.types import GraspAction, GraspCommand, TaskPhase

TYPE = "sms_handover_interfaces/msg/TaskPhase"
COMMANDS = (
    GraspCommand(GraspAction.GRASP, "arm_a", "end_a"),
    GraspCommand(GraspAction.TRANSFER, "arm_b", "end_b", "arm_a"),
)
PHASES = [
    TaskPhase(0, 0, "approach"),
    TaskPhase(20_000_000, 0, "approach"),
    TaskPhase(3_000_000_001, 1, "carry", COMMANDS[:1]),
    TaskPhase(3_020_000_000, 1, "carry"),
    TaskPhase(59_999_999_999, 2, "to the end", COMMANDS),
    TaskPhase(0, 0, "approach"),
]


def test_packed_bytes_are_those_of_rclpy() -> None:
    """But for padding, which rclpy leaves as it finds it, and what it may add behind the end."""
    codec, types = PhaseCodec(), MessageTypes()
    for phase in PHASES:
        data = codec.pack(phase)
        whole = serialize_message(phase_message(phase))
        assert types.deserialize(data, TYPE) == types.deserialize(whole, TYPE)
        assert 0 <= len(whole) - len(data) <= 8
        assert task_phase(deserialize_message(data, TaskPhaseMessage)) == phase
        again = types.serialize(types.deserialize(data, TYPE))
        assert len(again) == len(data)


@pytest.mark.parametrize("order", [PHASES, PHASES[::-1]])
def test_what_is_read_is_what_was_packed(order: list[TaskPhase]) -> None:
    packing, reading = PhaseCodec(), PhaseCodec()
    for phase in order:
        assert reading.read(packing.pack(phase)) == phase
        assert reading.read(serialize_message(phase_message(phase))) == phase
