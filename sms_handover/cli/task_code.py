"""Task code: the exit code of a run by how its task ended."""

from collections.abc import Iterable

from sms_handover.cli.exit_codes import EXIT_FAILED, EXIT_MISSED, EXIT_OK
from sms_handover.graph.events import GRASP_FAILED, RunEvent
from sms_handover.types import GraspEvent, GraspStatus


def task_code(grasps: Iterable[GraspEvent], decisions: Iterable[RunEvent], *, failed: bool) -> int:
    """Return the exit code of a run: failed for another reason than a grasp, a grasp missed, or succeeded.

    A grasp that missed and succeeded when it was repeated has not missed.
    """
    last = {event.command: event.status for event in grasps}
    if failed and all(event.kind != GRASP_FAILED for event in decisions):
        return EXIT_FAILED
    return EXIT_OK if all(status is GraspStatus.SUCCEEDED for status in last.values()) else EXIT_MISSED
