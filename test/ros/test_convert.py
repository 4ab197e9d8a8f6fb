"""Values become messages and come back with every bit, also through CDR."""

import re
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Pose as PoseMessage
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import GraspCommand as GraspCommandMessage
from sms_handover_interfaces.msg import GraspEvent as GraspEventMessage
from sms_handover_interfaces.msg import IkStatus as IkStatusMessage
from sms_handover_interfaces.msg import MpcStatus
from sms_handover_interfaces.msg import RunEvent as RunEventMessage
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage

import sms_handover
from sms_handover.errors import GraphError
from sms_handover.graph.events import RunEvent, Severity
from sms_handover.graph.message_constants import CONSTANTS, member_of
from sms_handover.messages.values import (
    grasp_event,
    header_ns,
    plan_report,
    run_event,
    status_values,
    task_phase,
    time_ns,
)
from sms_handover.plan_report import PlanReport, PlanStatus
from sms_handover.ros.codecs.convert import (
    event_message,
    header,
    joints_in_order,
    phase_message,
    plan_message,
    pose_of_message,
    run_event_message,
    set_ik_status,
    set_joint_positions,
    set_pose,
    time_message,
)
from sms_handover.types import (
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    IkResult,
    IkStatus,
    PhaseState,
    Pose,
    TaskPhase,
)
from sms_handover.units import NS_PER_S

PACKAGE = Path(sms_handover.__file__).parent
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
    assert time_ns(through_cdr(message)) == stamp_ns
    assert header_ns(GraspEventMessage(header=header(stamp_ns))) == stamp_ns


def test_pose_comes_back_bit_for_bit() -> None:
    pose = pose_with_awkward_numbers()
    back = pose_of_message(through_cdr(set_pose(PoseMessage(), pose)))
    assert back.position.tobytes() == pose.position.tobytes()
    assert back.quaternion_xyzw.tobytes() == pose.quaternion_xyzw.tobytes()


def test_quaternion_is_x_y_z_w() -> None:
    message = set_pose(PoseMessage(), Pose(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0, 7.0])))
    position, turn = message.position, message.orientation
    assert (position.x, position.y, position.z) == (1.0, 2.0, 3.0)
    assert (turn.x, turn.y, turn.z, turn.w) == (4.0, 5.0, 6.0, 7.0)


def test_a_header_is_in_world_or_where_it_is_said_to_be() -> None:
    assert (header(3).frame_id, header(3, "base_link").frame_id) == ("world", "base_link")


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
    capture: dict[str, Any] = {
        "relative_rate": errors[0],
        "relative_twist": (*errors, 0.1, -0.0, 5e-324),
        "impulse": (*errors, -1.0 / 3.0, 1e308, 0.0),
        "energy_lost": 3.8e-4,
    }
    event = GraspEvent(5 * NS_PER_S, command, status, *errors, "because of this", **capture)
    assert repr(grasp_event(through_cdr(event_message(event)))) == repr(event)  # NaN differs from itself


@pytest.mark.parametrize("severity", list(Severity))
@pytest.mark.parametrize("figures", [(0.25, 0.1, "s"), (NAN, NAN, "")])
def test_run_event_comes_back(severity: Severity, figures: tuple[float, float, str]) -> None:
    event = RunEvent(5 * NS_PER_S, "plant", "command_lost", severity, "kein Befehl — none", "carry", *figures)
    message = through_cdr(run_event_message(event))
    assert repr(run_event(message)) == repr(event)
    assert message.severity == getattr(RunEventMessage, severity.name)


DEFINITIONS: Mapping[type[Enum], Any] = {
    GraspAction: GraspCommandMessage,
    GraspStatus: GraspEventMessage,
    IkStatus: IkStatusMessage,
    PhaseState: TaskPhaseMessage,
    PlanStatus: MpcStatus,
    Severity: RunEventMessage,
}


def test_the_numbers_in_messages_are_the_constants_of_their_definitions() -> None:
    """Of every member of every enum, by name, whatever their order; and back."""
    members = [member for kind in DEFINITIONS for member in kind]
    assert {member: getattr(DEFINITIONS[type(member)], member.name) for member in members} == CONSTANTS
    assert [member_of(type(member), CONSTANTS[member]) for member in members] == members
    with pytest.raises(KeyError):
        member_of(GraspAction, len(GraspAction))


@pytest.mark.parametrize("status", list(PlanStatus))
def test_the_report_of_a_plan_comes_back(status: PlanStatus) -> None:
    report = PlanReport(
        40_000_000,
        3,
        status,
        17,
        ("rate of a", "distance b - c"),
        1e-3,
        "rate of a",
        1e-9,
        0.1,
        0.2,
        0.3,
        0.04,
        5,
        6,
    )
    assert plan_report(through_cdr(plan_message(report))) == report


def test_reordering_an_enum_changes_no_number() -> None:
    """No module counts the members of an enum that a message carries."""
    names = "|".join(kind.__name__ for kind in DEFINITIONS if kind is not Severity)  # bags have another of it
    counting = re.compile(rf"(?:enumerate|list|tuple|sorted|zip)\(\s*(?:{names})\b")
    found = [path.name for path in PACKAGE.rglob("*.py") if counting.search(path.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.parametrize("status", list(IkStatus))
def test_ik_status_tells_everything(status: IkStatus) -> None:
    result = IkResult(np.zeros(14), status, 17, 1e-7, 2e-8, 0.3, np.array([0.1, 1.0 / 3.0]), 0.02)
    message = through_cdr(set_ik_status(IkStatusMessage(), result, 40_000_000))
    assert message.status == getattr(IkStatusMessage, status.name)
    assert status_values(message) == (CONSTANTS[status],)
    assert header_ns(message) == 40_000_000
    assert message.iterations == 17
    assert (message.position_error, message.orientation_error) == (1e-7, 2e-8)
    assert (message.limit_margin, message.seed_distance) == (0.3, 0.02)
    assert list(message.manipulability) == [0.1, 1.0 / 3.0]


def test_joint_positions_tell_names_and_time() -> None:
    message = through_cdr(set_joint_positions(JointState(name=["one", "two"]), np.array([0.1, -0.0]), 7))
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
