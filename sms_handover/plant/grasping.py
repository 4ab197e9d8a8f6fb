"""Grasping: executes grasp commands and decides who holds the deputy afterwards."""

from collections.abc import Mapping
from math import nan

from sms_handover.plant.deputy import GraspErrors, GraspTolerance, MasslessDeputy
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus, Pose, Twist
from sms_handover.units import DEG_PER_RAD, MM_PER_M


def execute_grasp(
    command: GraspCommand,
    deputy: MasslessDeputy,
    tools_in_world: Mapping[str, Pose],
    tool_twists_in_world: Mapping[str, Twist],
    tolerance: GraspTolerance,
    stamp_ns: int,
) -> GraspEvent:
    """Execute one grasp command on the deputy and return the event.

    A grasp holds only if position, angle, relative speed and rate are within tolerance; otherwise it is
    missed and the holder stays the same. A command that contradicts the present holder is rejected.
    """
    rejection = _rejection(command, deputy.holder)
    if rejection:
        return _event(stamp_ns, command, GraspStatus.REJECTED, None, rejection)
    if command.action is GraspAction.RELEASE:
        deputy.detach()
        return _event(stamp_ns, command, GraspStatus.SUCCEEDED, None, f"{command.arm} let go")
    tool = tools_in_world[command.arm]
    tool_twist = tool_twists_in_world[command.arm]
    errors = deputy.errors_of(command.grasp_frame, tool, tool_twist)
    relative = deputy.twist_relative_to(tool, tool_twist)
    if not errors.within(tolerance):
        return _event(stamp_ns, command, GraspStatus.MISSED, errors, _miss(errors, tolerance), relative)
    deputy.attach(command.arm, tool)
    detail = f"{command.arm} holds the deputy"
    return _event(stamp_ns, command, GraspStatus.SUCCEEDED, errors, detail, relative)


def _rejection(command: GraspCommand, holder: str) -> str:
    """Return why a command contradicts the present ``holder``, or ''."""
    if command.action is GraspAction.RELEASE and holder != command.arm:
        return f"{command.arm} does not hold the deputy"
    if command.action is GraspAction.GRASP and holder:
        return f"{holder} holds the deputy already"
    if command.action is GraspAction.TRANSFER and holder != command.from_arm:
        return f"{command.from_arm} does not hold the deputy"
    return ""


def _miss(errors: GraspErrors, tolerance: GraspTolerance) -> str:
    """Return the errors that exceed their tolerance, with units."""
    table = (
        ("distance", errors.position, tolerance.position, MM_PER_M, "mm"),
        ("angle", errors.angle, tolerance.angle, DEG_PER_RAD, "deg"),
        ("speed", errors.speed, tolerance.speed, MM_PER_M, "mm/s"),
        ("rate", errors.rate, tolerance.rate, DEG_PER_RAD, "deg/s"),
    )
    return "; ".join(
        f"{name} {value * scale:.4g} {unit}, allowed {limit * scale:.4g} {unit}"
        for name, value, limit, scale, unit in table
        if not value <= limit
    )


def _event(
    stamp_ns: int,
    command: GraspCommand,
    status: GraspStatus,
    errors: GraspErrors | None,
    detail: str,
    relative_twist: tuple[float, ...] = (nan,) * 6,
) -> GraspEvent:
    """Return the event of a command; without errors their fields are NaN."""
    found = errors or GraspErrors(nan, nan, nan, nan)
    return GraspEvent(
        stamp_ns,
        command,
        status,
        found.position,
        found.angle,
        found.speed,
        detail,
        found.rate,
        relative_twist,
    )
