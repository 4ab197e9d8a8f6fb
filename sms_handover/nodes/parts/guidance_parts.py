"""Parts of the guidance of a controller, which come as messages of their own."""

from collections.abc import Sequence
from typing import Any

from sms_handover.control.protocol import Guidance
from sms_handover.graph.topics import JOINT_REFERENCE, TASK_PHASE, target_pose
from sms_handover.types import JointReference


class GuidanceParts:
    """Collects phase, joint reference and the targets of some tools until all are of the same instant."""

    def __init__(self, arms: Sequence[str]) -> None:
        """Await the targets of these arms besides phase and reference."""
        self._arms = {target_pose(arm): arm for arm in arms}
        self.topics = (TASK_PHASE, JOINT_REFERENCE, *self._arms)
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._parts: dict[str, tuple[int, Any]] = {}
        self.reference_ns = 0  # stamp of the last complete guidance
        self.complete = False  # whether there has been one

    def add(self, topic: str, stamp_ns: int, content: Any) -> Guidance | None:
        """Add one part; return the guidance if this is the last part of its instant."""
        self._parts[topic] = stamp_ns, content
        if {stamp for stamp, _ in self._parts.values()} != {stamp_ns} or len(self._parts) < len(self.topics):
            return None
        self.reference_ns, self.complete = stamp_ns, True
        reference = JointReference(stamp_ns, *self._parts[JOINT_REFERENCE][1])
        targets = {arm: self._parts[name][1] for name, arm in self._arms.items()}
        return Guidance(self._parts[TASK_PHASE][1], reference, targets)
