"""Completion of a run: whether it did its task without passing through anything, and what it lacks."""

from collections.abc import Iterator
from dataclasses import dataclass

from sms_handover.analysis.clearance import GroupClearance, RunClearance
from sms_handover.analysis.phases import phase_spans
from sms_handover.run_data import RunData
from sms_handover.types import GraspAction, GraspCommand, GraspStatus
from sms_handover.units import MM_PER_M, ns_to_seconds


@dataclass(frozen=True)
class Completion:
    """Whether a run did its task: ``shortfalls`` has what it lacks in words, and is empty where it did.

    ``clearance_known`` is False where the bodies of the run are unknown, so that nothing is known of
    collisions.
    """

    shortfalls: tuple[str, ...]
    clearance_known: bool

    @property
    def complete(self) -> bool:
        """Whether nothing is known to be lacking."""
        return not self.shortfalls


def completion(run: RunData, clearance: RunClearance | None) -> Completion:
    """Return whether a run did its task.

    It did if every grasp command succeeded, no phase failed, the run went on to the end of its task, and
    no bodies came nearer than allowed, which is judged where ``clearance`` is known.
    """
    return Completion((*_of_task(run), *collisions_in_words(clearance)), clearance is not None)


def collisions_in_words(clearance: RunClearance | None) -> tuple[str, ...]:
    """Return each collision in a line: the bodies, how deep they were in each other, and when."""
    return tuple(map(_in_words, clearance.collisions)) if clearance else ()


def command_in_words(command: GraspCommand) -> str:
    """Return a grasp command in words."""
    if command.action is GraspAction.RELEASE:
        return f"{command.arm} lets go"
    giver = f" from {command.from_arm}" if command.from_arm else ""
    return f"{command.arm} takes {command.grasp_frame}{giver}"


def _of_task(run: RunData) -> Iterator[str]:
    """Yield what a run lacks of its task."""
    spans = phase_spans(run)
    if not spans:
        yield "no phase of a task was recorded"
        return
    for event in run.grasp_events:
        if event.status is not GraspStatus.SUCCEEDED:
            time = ns_to_seconds(event.stamp_ns)
            yield f"{time:g} s: {command_in_words(event.command)}: {event.status.value}"
    for phase in run.phases:
        if phase.failed:
            yield f"phase {phase.name} failed at {ns_to_seconds(phase.stamp_ns):g} s"
            break
    end_ns, expected_ns = spans[-1].end_ns, run.phases[-1].end_ns
    if end_ns < expected_ns:
        yield f"ended at {ns_to_seconds(end_ns):g} s, the task ends at {ns_to_seconds(expected_ns):g} s"


def _in_words(group: GroupClearance) -> str:
    """Return a collision in words."""
    one, other = group.bodies
    limit = f", where {-group.allowed * MM_PER_M:g} mm is allowed" if group.allowed else ""
    depth, time = -group.least * MM_PER_M, ns_to_seconds(group.stamp_ns)
    return f"{one} and {other} {depth:.2f} mm in each other at {time:.2f} s{limit}"
