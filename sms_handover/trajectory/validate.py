"""Validation of a schedule without robot motion: times, names, and who holds the deputy when."""

from collections.abc import Sequence

from sms_handover.configuration.sections import Section
from sms_handover.errors import ScheduleError
from sms_handover.trajectory.schedule import GraspFrameTarget, Phase
from sms_handover.types import GraspAction, GraspCommand
from sms_handover.units import ns_to_seconds


def check_phases(phases: Sequence[Phase], sections: Sequence[Section], period_ns: int) -> None:
    """Raise ScheduleError with line and phase where the phases cannot be carried out in order.

    Phases begin and end on a reference period, names are unique, and at every instant at
    most one arm holds the deputy: no grasp while it is held, no release by an arm that does not hold it.
    The arm that holds it is not sent to a grasp frame, which would move with that arm.
    """
    holder = ""
    names: set[str] = set()
    for phase, section in zip(phases, sections, strict=True):
        where = f"{section.where()}: phase {phase.name!r}"
        if phase.name in names:
            raise ScheduleError(f"{where} has the name of an earlier phase")
        names.add(phase.name)
        if phase.end_ns % period_ns:
            raise ScheduleError(
                f"{where} ends at {ns_to_seconds(phase.end_ns):g} s, must be a multiple of the "
                f"reference period of {ns_to_seconds(period_ns):g} s"
            )
        for command in phase.commands:
            holder = _holder_after(command, holder, where)
        target = phase.targets.get(holder)
        if isinstance(target, GraspFrameTarget):
            raise ScheduleError(
                f"{where}: {holder} holds the deputy, so its target at grasp frame {target.grasp_frame!r} "
                "would move with the arm itself; use hold, joints or tool_in_world"
            )


def _holder_after(command: GraspCommand, holder: str, where: str) -> str:
    """Return the holder of the deputy after a command that succeeds."""
    if command.action is GraspAction.RELEASE:
        if holder != command.arm:
            other = holder or "no arm"
            raise ScheduleError(f"{where}: {command.arm} releases the deputy, but {other} holds it")
        return ""
    if command.action is GraspAction.TRANSFER:
        if command.from_arm == command.arm:
            raise ScheduleError(f"{where}: a transfer from {command.arm} to itself")
        if holder != command.from_arm:
            raise ScheduleError(
                f"{where}: a transfer from {command.from_arm}, but {holder or 'no arm'} holds the deputy"
            )
    elif holder:
        raise ScheduleError(
            f"{where}: {command.arm} grasps the deputy while {holder} holds it; two arms that hold it "
            "would close a kinematic chain, use a transfer"
        )
    return command.arm
