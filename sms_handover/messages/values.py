"""Values of the core from decoded messages, for the topics outside the hot path."""

from dataclasses import replace
from typing import Any

import numpy as np

from sms_handover.graph.events import RunEvent, Severity
from sms_handover.graph.message_constants import member_of
from sms_handover.plan_report import PlannedPaths, PlanReport, PlanStatus
from sms_handover.types import (
    BaseWrench,
    Collision,
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    PhaseState,
    TaskPhase,
)
from sms_handover.units import NS_PER_S


def pose_values(message: Any) -> tuple[float, ...]:
    """Return position and quaternion of a PoseStamped."""
    position, turn = message.pose.position, message.pose.orientation
    return position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w


def vector_values(message: Any) -> tuple[float, ...]:
    """Return the components of a Vector3Stamped."""
    return message.vector.x, message.vector.y, message.vector.z


def base_wrench(message: Any) -> BaseWrench:
    """Return the wrench of a WrenchStamped."""
    force, torque = message.wrench.force, message.wrench.torque
    parts = [(float(part.x), float(part.y), float(part.z)) for part in (force, torque)]
    return BaseWrench(header_ns(message), message.header.frame_id, *parts)


def energy_values(message: Any) -> tuple[float, ...]:
    """Return kinetic energy, work, external work and losses of an EnergyStamped; older ones have two."""
    return (
        message.kinetic,
        message.work,
        getattr(message, "external_work", 0.0),
        getattr(message, "lost", 0.0),
    )


def twist_values(message: Any) -> tuple[float, ...]:
    """Return the twist of an Odometry, linear then angular, in axes of the child frame."""
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    return linear.x, linear.y, linear.z, angular.x, angular.y, angular.z


def status_values(message: Any) -> tuple[float, ...]:
    """Return the number of an IkStatus."""
    return (message.status,)


def header_ns(message: Any) -> int:
    """Return the stamp in the header of a message."""
    return time_ns(message.header.stamp)


def time_ns(message: Any) -> int:
    """Return a Time message in ns."""
    return int(message.sec) * NS_PER_S + int(message.nanosec)


def task_phase(message: Any) -> TaskPhase:
    """Return the value of a TaskPhase."""
    commands = tuple(grasp_command(command) for command in message.commands)
    phase = TaskPhase(header_ns(message), int(message.index), message.name, commands)
    if not hasattr(message, "state"):
        return phase  # recorded before phases could fail
    state, attempt = member_of(PhaseState, message.state), int(message.attempt)
    return replace(phase, state=state, attempt=attempt, end_ns=time_ns(message.end))


def grasp_command(message: Any) -> GraspCommand:
    """Return a GraspCommand message as its value."""
    action = member_of(GraspAction, message.action)
    return GraspCommand(action, message.arm, message.grasp_frame, message.from_arm)


def grasp_event(message: Any) -> GraspEvent:
    """Return the value of a GraspEvent."""
    event = GraspEvent(
        stamp_ns=header_ns(message),
        command=grasp_command(message.command),
        status=member_of(GraspStatus, message.status),
        position_error=message.position_error,
        angle_error=message.angle_error,
        relative_speed=message.relative_speed,
        detail=message.detail,
    )
    if not hasattr(message, "impulse"):
        return event  # recorded before the deputy could have a mass
    twist, impulse = message.relative_twist, message.impulse
    return replace(
        event,
        relative_rate=message.relative_rate,
        relative_twist=(*_components(twist.linear), *_components(twist.angular)),
        impulse=(*_components(impulse.force), *_components(impulse.torque)),
        energy_lost=message.energy_lost,
    )


def _components(vector: Any) -> tuple[float, float, float]:
    """Return the components of a Vector3 or a Point."""
    return vector.x, vector.y, vector.z


def collisions(message: Any) -> tuple[Collision, ...]:
    """Return the groups of a Clearance whose bodies are nearer to each other than is allowed."""
    stamp_ns = header_ns(message)
    return tuple(
        Collision(stamp_ns, item.group, (item.first_body, item.second_body), item.distance, item.allowed)
        for item in message.groups
        if item.distance < item.allowed
    )


def plan_report(message: Any) -> PlanReport:
    """Return the value of an MpcStatus."""
    return PlanReport(
        stamp_ns=header_ns(message),
        plan=int(message.plan),
        status=member_of(PlanStatus, message.status),
        iterations=int(message.iterations),
        active=tuple(message.active),
        largest_slack=message.largest_slack,
        largest_slack_row=message.largest_slack_row,
        kkt_residual=message.kkt_residual,
        linearization_time=message.linearization_time,
        program_time=message.program_time,
        total_time=message.total_time,
        plan_age=message.plan_age,
        late_plans=int(message.late_plans),
        reused_plans=int(message.reused_plans),
    )


def planned_paths(message: Any) -> PlannedPaths:
    """Return the value of a MarkerArray with a line per arm; raises KeyError unless it has any."""
    if not message.markers:
        raise KeyError("a line per arm")
    lines = {
        marker.ns: np.array([_components(point) for point in marker.points]) for marker in message.markers
    }
    return PlannedPaths(header_ns(message.markers[0]), lines)


def run_event(message: Any) -> RunEvent:
    """Return the value of a RunEvent."""
    return RunEvent(
        stamp_ns=header_ns(message),
        node=message.node,
        kind=message.kind,
        severity=member_of(Severity, message.severity),
        detail=message.detail,
        phase=message.phase,
        value=message.value,
        limit=message.limit,
        unit=message.unit,
    )
