"""Values become messages and come back with every bit, also through CDR."""

from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sms_handover_interfaces.msg import GraspEvent as GraspEventMessage
from sms_handover_interfaces.msg import IkStatus as IkStatusMessage
from sms_handover_interfaces.msg import RunEvent as RunEventMessage
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

from sms_handover.errors import GraphError
from sms_handover.graph.events import RunEvent, Severity
from sms_handover.messages.values import (
    energy_values,
    grasp_event,
    header_ns,
    pose_values,
    run_event,
    status_values,
    task_phase,
    vector_values,
)
from sms_handover.ros.codecs.convert import (
    energy_message,
    event_message,
    header,
    ik_status_message,
    joint_positions_message,
    joints_in_order,
    phase_message,
    pose_message,
    pose_of_message,
    pose_stamped,
    run_event_message,
    stamp_ns_of,
    time_message,
    vector_stamped,
)
from sms_handover.simulation.recorder import IK_STATUS_NUMBER
from sms_handover.types import (
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    IkResult,
    IkStatus,
    Pose,
    TaskPhase,
)
from sms_handover.units import NS_PER_S

NAN = float("nan")


def through_cdr(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


def pose_with_awkward_numbers() -> Pose:
    return Pose(np.array([0.1, -0.0, 5e-324]), np.array([-1.0 / 3.0, 1e308, np.nextafter(1.0, 2.0), -0.0]))


@pytest.mark.parametrize(
    "stamp_ns", [0, 1, NS_PER_S - 1, NS_PER_S, 61_234_567_890, (2**31 - 1) * NS_PER_S + 999_999_999]
)
def test_time_comes_back(stamp_ns: int) -> None:
    message = time_message(stamp_ns)
    assert 0 <= message.nanosec < NS_PER_S
    assert stamp_ns_of(through_cdr(message)) == stamp_ns
    assert header_ns(pose_stamped(pose_with_awkward_numbers(), stamp_ns)) == stamp_ns


def test_pose_comes_back_bit_for_bit() -> None:
    pose = pose_with_awkward_numbers()
    back = pose_of_message(through_cdr(pose_message(pose)))
    assert back.position.tobytes() == pose.position.tobytes()
    assert back.quaternion_xyzw.tobytes() == pose.quaternion_xyzw.tobytes()


def test_quaternion_is_x_y_z_w() -> None:
    message = pose_message(Pose(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0, 7.0])))
    position, turn = message.position, message.orientation
    assert (position.x, position.y, position.z) == (1.0, 2.0, 3.0)
    assert (turn.x, turn.y, turn.z, turn.w) == (4.0, 5.0, 6.0, 7.0)


def test_stamped_messages_are_in_world() -> None:
    pose = pose_with_awkward_numbers()
    stamped = through_cdr(pose_stamped(pose, 7))
    assert (stamped.header.frame_id, header_ns(stamped)) == ("world", 7)
    assert (
        np.array(pose_values(stamped)).tobytes() == np.hstack([pose.position, pose.quaternion_xyzw]).tobytes()
    )
    vector = through_cdr(vector_stamped(np.array([0.1, -0.0, 3.0]), 8))
    assert (vector.header.frame_id, header_ns(vector)) == ("world", 8)
    assert np.array(vector_values(vector)).tobytes() == np.array([0.1, -0.0, 3.0]).tobytes()
    energy = through_cdr(energy_message(1.0 / 3.0, -2.5, 9))
    assert (energy.header.frame_id, header_ns(energy), energy_values(energy)) == (
        "world",
        9,
        (1.0 / 3.0, -2.5),
    )
    assert header(3, "base_link").frame_id == "base_link"


GRASP = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
RELEASE = GraspCommand(GraspAction.RELEASE, "arm_a")
TRANSFER = GraspCommand(GraspAction.TRANSFER, "arm_b", "end_b", "arm_a")


@pytest.mark.parametrize("commands", [(), (GRASP,), (RELEASE,), (TRANSFER,), (GRASP, TRANSFER, RELEASE)])
def test_phase_comes_back(commands: tuple[GraspCommand, ...]) -> None:
    phase = TaskPhase(61_234_567_890, 2, "withdraw — Rückzug", commands)
    assert task_phase(through_cdr(phase_message(phase))) == phase


@pytest.mark.parametrize("command", [GRASP, RELEASE, TRANSFER])
@pytest.mark.parametrize("status", list(GraspStatus))
@pytest.mark.parametrize("errors", [(0.001, 0.02, 3e-4), (NAN, NAN, NAN)])
def test_event_comes_back(
    command: GraspCommand, status: GraspStatus, errors: tuple[float, float, float]
) -> None:
    event = GraspEvent(5 * NS_PER_S, command, status, *errors, "because of this")
    assert repr(grasp_event(through_cdr(event_message(event)))) == repr(event)  # NaN differs from itself


@pytest.mark.parametrize("severity", list(Severity))
@pytest.mark.parametrize("figures", [(0.25, 0.1, "s"), (NAN, NAN, "")])
def test_run_event_comes_back(severity: Severity, figures: tuple[float, float, str]) -> None:
    event = RunEvent(5 * NS_PER_S, "plant", "command_lost", severity, "kein Befehl — none", "carry", *figures)
    message = through_cdr(run_event_message(event))
    assert repr(run_event(message)) == repr(event)
    assert message.severity == getattr(RunEventMessage, severity.name)


def test_numbers_of_grasp_messages_are_those_of_their_definitions() -> None:
    command = GraspEventMessage().command
    phase = phase_message(TaskPhase(0, 0, "", (GRASP, RELEASE, TRANSFER)))
    assert [c.action for c in phase.commands] == [command.GRASP, command.RELEASE, command.TRANSFER]
    numbers = [event_message(GraspEvent(0, GRASP, s, NAN, NAN, NAN, "")).status for s in GraspStatus]
    assert numbers == [GraspEventMessage.SUCCEEDED, GraspEventMessage.MISSED, GraspEventMessage.REJECTED]
    assert isinstance(phase, TaskPhaseMessage)


@pytest.mark.parametrize("status", list(IkStatus))
def test_ik_status_tells_everything(status: IkStatus) -> None:
    result = IkResult(np.zeros(14), status, 17, 1e-7, 2e-8, 0.3, np.array([0.1, 1.0 / 3.0]), 0.02)
    message = through_cdr(ik_status_message(result, 40_000_000))
    assert message.status == getattr(IkStatusMessage, status.name)
    assert status_values(message) == (IK_STATUS_NUMBER[status],)  # a bag and a simulation tell the same
    assert header_ns(message) == 40_000_000
    assert message.iterations == 17
    assert (message.position_error, message.orientation_error) == (1e-7, 2e-8)
    assert (message.limit_margin, message.seed_distance) == (0.3, 0.02)
    assert list(message.manipulability) == [0.1, 1.0 / 3.0]


def test_joint_positions_tell_names_and_time() -> None:
    message = through_cdr(joint_positions_message(("one", "two"), np.array([0.1, -0.0]), 7))
    assert list(message.name) == ["one", "two"]
    assert np.array(message.position).tobytes() == np.array([0.1, -0.0]).tobytes()
    assert (len(message.velocity), len(message.effort), header_ns(message)) == (0, 0, 7)


def test_joints_are_put_in_order() -> None:
    assert joints_in_order(("a", "b"), ("c", "b", "a"), (1.0, 2.0, 3.0)).tolist() == [3.0, 2.0]


@pytest.mark.parametrize(
    ("names", "values", "match"),
    [
        (("a",), (1.0,), "lacks 'b'"),
        (("a", "b"), (1.0,), "2 names and 1 values"),
        (("a", "b"), (), "2 names and 0 values"),
        ((), (), "lacks 'a'"),
    ],
)
def test_incomplete_joints_are_refused(names: tuple[str, ...], values: tuple[float, ...], match: str) -> None:
    with pytest.raises(GraphError, match=match):
        joints_in_order(("a", "b"), names, values)
