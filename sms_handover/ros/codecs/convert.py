"""Conversion of the values of the core to messages and back; every number keeps its bits.

Phases and grasp events are read back by :mod:`sms_handover.messages.values`, which reads fields by name.
"""

from array import array
from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Twist, Vector3, Wrench
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import BodyClearance, MpcStatus
from sms_handover_interfaces.msg import Clearance as ClearanceMessage
from sms_handover_interfaces.msg import GraspCommand as GraspCommandMessage
from sms_handover_interfaces.msg import GraspEvent as GraspEventMessage
from sms_handover_interfaces.msg import IkStatus as IkStatusMessage
from sms_handover_interfaces.msg import RunEvent as RunEventMessage
from sms_handover_interfaces.msg import TaskPhase as TaskPhaseMessage
from std_msgs.msg import Header

from sms_handover.clearance.monitor import GroupDistance, PeriodClearance
from sms_handover.errors import MessageError, Reason
from sms_handover.frames import WORLD
from sms_handover.graph.events import RunEvent
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.plan_report import PlanReport
from sms_handover.types import Array, GraspCommand, GraspEvent, IkResult, Pose, TaskPhase, frozen
from sms_handover.units import NS_PER_S


def time_message(stamp_ns: int) -> Time:
    """Return a time message from integer nanoseconds."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def header(stamp_ns: int, frame: str = WORLD) -> Header:
    """Return a header with a stamp and a frame."""
    return Header(stamp=time_message(stamp_ns), frame_id=frame)


def set_pose(message: PoseMessage, pose: Pose) -> PoseMessage:
    """Fill a message with a pose, and return it."""
    position, orientation = message.position, message.orientation
    position.x, position.y, position.z = pose.position.tolist()
    orientation.x, orientation.y, orientation.z, orientation.w = pose.quaternion_xyzw.tolist()
    return message


def pose_of_message(message: PoseMessage) -> Pose:
    """Return the pose in a message."""
    p, o = message.position, message.orientation
    row = frozen(np.array([p.x, p.y, p.z, o.x, o.y, o.z, o.w]))
    return Pose(row[:3], row[3:])


def set_joint_positions(message: JointState, position: Array, stamp_ns: int) -> JointState:
    """Fill a message that has the names with joint angles, and return it."""
    message.header.stamp = time_message(stamp_ns)
    message.position = array("d", position.tobytes())
    return message


def joints_in_order(names: Sequence[str], message_names: Sequence[str], values: Sequence[float]) -> Array:
    """Return the values of a joint message in the order of ``names``.

    Raises MessageError if one is missing or given twice, or if there are not as many values as names.
    """
    if message_names == names and len(values) == len(names):
        return np.array(values, dtype=np.float64)
    if len(message_names) != len(values):
        text = f"a joint message has {len(message_names)} names and {len(values)} values"
        raise MessageError(Reason.LENGTHS, text)
    by_name: Mapping[str, float] = dict(zip(message_names, values, strict=True))
    missing = [name for name in names if name not in by_name]
    if missing:
        raise MessageError(Reason.NAMES, f"a joint message lacks {missing[0]!r}")
    if len(by_name) < len(message_names):
        raise MessageError(Reason.NAMES, "a joint message has a joint twice")
    return np.array([by_name[name] for name in names])


def phase_message(phase: TaskPhase) -> TaskPhaseMessage:
    """Return a phase and its commands as a message."""
    return TaskPhaseMessage(
        header=header(phase.stamp_ns),
        index=phase.index,
        name=phase.name,
        commands=[_command_message(command) for command in phase.commands],
        state=CONSTANTS[phase.state],
        attempt=phase.attempt,
        end=time_message(phase.end_ns),
    )


def event_message(event: GraspEvent) -> GraspEventMessage:
    """Return a grasp event as a message."""
    return GraspEventMessage(
        header=header(event.stamp_ns),
        command=_command_message(event.command),
        status=CONSTANTS[event.status],
        position_error=event.position_error,
        angle_error=event.angle_error,
        relative_speed=event.relative_speed,
        relative_rate=event.relative_rate,
        detail=event.detail,
        relative_twist=Twist(
            linear=_vector(event.relative_twist[:3]), angular=_vector(event.relative_twist[3:])
        ),
        impulse=Wrench(force=_vector(event.impulse[:3]), torque=_vector(event.impulse[3:])),
        energy_lost=event.energy_lost,
    )


def _vector(components: Sequence[float]) -> Vector3:
    """Return three numbers as a message."""
    x, y, z = components
    return Vector3(x=x, y=y, z=z)


def clearance_message(clearance: PeriodClearance) -> ClearanceMessage:
    """Return the clearance of a period as a message."""
    groups = [_group_message(item) for item in clearance.groups]
    return ClearanceMessage(header=header(clearance.stamp_ns), groups=groups)


def _group_message(item: GroupDistance) -> BodyClearance:
    first, second = (Point(x=x, y=y, z=z) for x, y, z in item.nearest.points_in_world.tolist())
    return BodyClearance(
        group=item.group,
        first_body=item.bodies[0],
        second_body=item.bodies[1],
        distance=item.distance,
        allowed=item.allowed,
        first_point=first,
        second_point=second,
    )


def plan_message(report: PlanReport) -> MpcStatus:
    """Return the report of a solve as a message."""
    return MpcStatus(
        header=header(report.stamp_ns),
        plan=report.plan,
        status=CONSTANTS[report.status],
        iterations=report.iterations,
        active=list(report.active),
        largest_slack=report.largest_slack,
        largest_slack_row=report.largest_slack_row,
        kkt_residual=report.kkt_residual,
        linearization_time=report.linearization_time,
        program_time=report.program_time,
        total_time=report.total_time,
        plan_age=report.plan_age,
        late_plans=report.late_plans,
        reused_plans=report.reused_plans,
    )


def run_event_message(event: RunEvent) -> RunEventMessage:
    """Return an event of a run as a message."""
    return RunEventMessage(
        header=header(event.stamp_ns),
        node=event.node,
        kind=event.kind,
        severity=CONSTANTS[event.severity],
        phase=event.phase,
        detail=event.detail,
        value=event.value,
        limit=event.limit,
        unit=event.unit,
    )


def set_ik_status(message: IkStatusMessage, result: IkResult, stamp_ns: int) -> IkStatusMessage:
    """Fill a message that has a frame with how a solve ended, and return it."""
    message.header.stamp = time_message(stamp_ns)
    message.status = CONSTANTS[result.status]
    message.iterations = result.iterations
    message.position_error = result.position_error
    message.orientation_error = result.orientation_error
    message.limit_margin = result.limit_margin
    message.manipulability = array("d", result.manipulability.tobytes())
    message.seed_distance = result.seed_distance
    return message


def _command_message(command: GraspCommand) -> GraspCommandMessage:
    return GraspCommandMessage(
        action=CONSTANTS[command.action],
        arm=command.arm,
        grasp_frame=command.grasp_frame,
        from_arm=command.from_arm,
    )
