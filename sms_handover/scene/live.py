"""Live scene: it grows while a graph runs, for any number of viewers."""

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Condition

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.plan_report import PlannedPaths
from sms_handover.scene.document import (
    Document,
    moving_document,
    planned_document,
    still_document,
    task_document,
)
from sms_handover.scene.links import DescribedRobot
from sms_handover.scene.planned_lines import planned_lines
from sms_handover.scene.scene import FRAME_RATE
from sms_handover.scene.shapes import read_shapes
from sms_handover.types import Array, GraspEvent, TaskPhase
from sms_handover.units import NS_PER_S

_MOST_FRAMES = 45_000  # [-] half an hour at 25 per s, 30 MB


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One instant: joints (n,) rad by name, and poses (7,) in ``world``; targets per arm."""

    stamp_ns: int
    joint_names: tuple[str, ...]
    joint_position: Array
    base_in_world: Array
    deputy_in_world: Array
    target_in_world: Mapping[str, Array]


@dataclass(frozen=True)
class Seen:
    """How much of a live scene a viewer has: the number of the run, and of its frames and plans."""

    run: int = 0
    frames: int = 0
    plans: int = 0


class LiveScene:
    """Collects what a graph publishes and hands out what is new; one thread may add while others read."""

    def __init__(self, urdf: str, deputy_size: Array, frame_rate: float = FRAME_RATE) -> None:
        """Describe robot and deputy; raises RobotDescriptionError, ConfigurationError."""
        if not frame_rate > 0.0:
            raise ConfigurationError(f"frame rate is {frame_rate:g} 1/s, it must be > 0")
        self._robot = DescribedRobot(urdf)
        self.arms = self._robot.arms
        self.joint_names = self._robot.joint_names
        shapes = read_shapes(self._robot.pin, urdf)
        self._still = still_document("live", shapes, self._robot.links, self.arms, deputy_size)
        self._step_ns = round(NS_PER_S / frame_rate)
        self._changed = Condition()
        self._run = 0
        self._reset()

    def add(self, frame: LiveFrame) -> None:
        """Add an instant if one is due; a stamp that goes back starts another run."""
        with self._changed:
            if self._stamps and frame.stamp_ns < self._stamps[-1]:
                self._reset()
            if self._stamps and frame.stamp_ns < self._stamps[-1] + self._step_ns:
                return
            links = self._robot.poses(
                frame.base_in_world[None], frame.joint_position[None], frame.joint_names
            )[0]
            targets = [frame.target_in_world[arm] for arm in self.arms]
            if len(self._stamps) == _MOST_FRAMES:
                self._drop_half()
            self._stamps.append(frame.stamp_ns)
            self._poses.append(np.vstack([links, frame.deputy_in_world, *targets]))
            self._changed.notify_all()

    def set_phase(self, phase: TaskPhase) -> None:
        """Set the current phase; only its start is kept."""
        with self._changed:
            if phase.stamp_ns == 0 and self._stamps and self._stamps[-1] > 0:
                self._reset()  # its first frame is still to come
            if not self._phases or self._phases[-1].index != phase.index:
                self._phases.append(phase)

    def add_event(self, event: GraspEvent) -> None:
        """Add the outcome of a grasp command."""
        with self._changed:
            self._events.append(event)

    def add_paths(self, paths: PlannedPaths) -> None:
        """Add the paths of a plan if they are due, to be told with the next instant.

        A stamp that goes back starts another run.
        """
        with self._changed:
            if self._paths and paths.stamp_ns < self._paths[-1].stamp_ns:
                self._reset()  # its first frame is still to come
            if self._paths and paths.stamp_ns < self._paths[-1].stamp_ns + self._step_ns:
                return
            self._paths.append(paths)

    def updates(self, seen: Seen, timeout: float) -> tuple[Document, Seen] | None:
        """Return what is new since ``seen``, the whole scene if another run has started.

        Waits up to ``timeout`` s; None if there is nothing new.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._stamps and self._seen != seen, timeout):
                return None
            known = seen if seen.run == self._run else Seen()
            first, planned = known.frames, planned_lines(self._paths[known.plans :], self.arms)
            document = {
                **(self._still if first == 0 else {}),
                **moving_document(np.array(self._stamps[first:]), np.array(self._poses[first:])),
                **task_document(self._phases, self._events),
                **({"planned": planned_document(planned)} if planned else {}),
            }
            return document, self._seen

    @property
    def _seen(self) -> Seen:
        """Return the state of a viewer that is up to date."""
        return Seen(self._run, len(self._stamps), len(self._paths))

    def _reset(self) -> None:
        """Start another run, without frames."""
        self._run += 1
        self._stamps: list[int] = []
        self._poses: list[Array] = []
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []
        self._paths: list[PlannedPaths] = []

    def _drop_half(self) -> None:
        """Drop the older half of the frames, and their plans; every viewer gets the rest again."""
        self._run += 1
        del self._stamps[: _MOST_FRAMES // 2], self._poses[: _MOST_FRAMES // 2]
        self._paths = [paths for paths in self._paths if paths.stamp_ns >= self._stamps[0]]
