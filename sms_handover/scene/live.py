"""A scene that grows while a graph runs, for any number of pages that look at it."""

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Condition

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.scene.document import Document, moving_document, still_document, task_document
from sms_handover.scene.links import DescribedRobot
from sms_handover.scene.scene import FRAME_RATE
from sms_handover.scene.shapes import read_shapes
from sms_handover.types import Array, GraspEvent, TaskPhase
from sms_handover.units import NS_PER_S

_MOST_FRAMES = 45_000  # [-] kept: half an hour at 25 per s, 30 MB


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One instant: joints (n,) rad by name, and poses (7,) in ``world``, those of the targets per arm."""

    stamp_ns: int
    joint_names: tuple[str, ...]
    joint_position: Array
    base_in_world: Array
    deputy_in_world: Array
    target_in_world: Mapping[str, Array]


@dataclass(frozen=True)
class Seen:
    """How much of a live scene somebody has: of which run, and how many of its frames."""

    run: int = 0
    frames: int = 0


class LiveScene:
    """Takes what a graph publishes and hands out what is new; one thread may add while others read."""

    def __init__(self, urdf: str, deputy_size: Array, frame_rate: float = FRAME_RATE) -> None:
        """Describe what there is to see; raises RobotDescriptionError, ConfigurationError."""
        if not frame_rate > 0.0:
            raise ConfigurationError(f"frame rate is {frame_rate:g} 1/s, it must be positive")
        self._robot = DescribedRobot(urdf)
        self.arms = self._robot.arms
        self.joint_names = self._robot.joint_names
        shapes = read_shapes(self._robot.pin, urdf)
        self._still = still_document("live", shapes, self._robot.links, self.arms, deputy_size)
        self._step_ns = round(NS_PER_S / frame_rate)
        self._changed = Condition()
        self._run = 0
        self._begin()

    def add(self, frame: LiveFrame) -> None:
        """Take an instant, if one is due; a stamp that goes back begins another run."""
        with self._changed:
            if self._stamps and frame.stamp_ns < self._stamps[-1]:
                self._begin()
            if self._stamps and frame.stamp_ns < self._stamps[-1] + self._step_ns:
                return
            links = self._robot.poses(
                frame.base_in_world[None], frame.joint_position[None], frame.joint_names
            )[0]
            targets = [frame.target_in_world[arm] for arm in self.arms]
            if len(self._stamps) == _MOST_FRAMES:
                self._forget_half()
            self._stamps.append(frame.stamp_ns)
            self._poses.append(np.vstack([links, frame.deputy_in_world, *targets]))
            self._changed.notify_all()

    def enter(self, phase: TaskPhase) -> None:
        """Take notice of the phase in force; only where it begins counts."""
        with self._changed:
            if phase.stamp_ns == 0 and self._stamps and self._stamps[-1] > 0:
                self._begin()  # its first frame is still to come
            if not self._phases or self._phases[-1].index != phase.index:
                self._phases.append(phase)

    def tell(self, event: GraspEvent) -> None:
        """Take notice of what came of a grasp command."""
        with self._changed:
            self._events.append(event)

    def news(self, seen: Seen, timeout: float) -> tuple[Document, Seen] | None:
        """Return what is new to somebody who has ``seen``, whole if another run has begun.

        Waits up to ``timeout`` s for it; None if nothing has come.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._stamps and self._seen != seen, timeout):
                return None
            first = seen.frames if seen.run == self._run else 0
            document = {
                **(self._still if first == 0 else {}),
                **moving_document(np.array(self._stamps[first:]), np.array(self._poses[first:])),
                **task_document(self._phases, self._events),
            }
            return document, self._seen

    @property
    def _seen(self) -> Seen:
        """Return what somebody has who has everything."""
        return Seen(self._run, len(self._stamps))

    def _begin(self) -> None:
        """Forget the run so far."""
        self._run += 1
        self._stamps: list[int] = []
        self._poses: list[Array] = []
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []

    def _forget_half(self) -> None:
        """Forget the older half of the frames; everybody gets the rest anew."""
        self._run += 1
        del self._stamps[: _MOST_FRAMES // 2], self._poses[: _MOST_FRAMES // 2]
