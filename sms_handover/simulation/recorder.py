"""Run recorder: collects the rows of a run and returns them as arrays."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from sms_handover.graph.events import RunEvent
from sms_handover.model.conserved import ConservedQuantities
from sms_handover.run_data import RunData
from sms_handover.types import (
    BASE_NQ,
    BASE_NV,
    Array,
    GraspEvent,
    IkStatus,
    JointReference,
    Pose,
    TaskPhase,
)

N = TypeVar("N", bound=np.generic)

IK_STATUS_NUMBER: Mapping[IkStatus, int] = {status: number for number, status in enumerate(IkStatus)}


class RunRecorder:
    """Preallocated arrays for a run of known length, filled row by row."""

    def __init__(self, joint_names: tuple[str, ...], arms: tuple[str, ...], ticks: int, periods: int) -> None:
        """Make room for ``ticks`` states and ``periods`` references."""
        n = len(joint_names)
        self._joint_names, self._arms = joint_names, arms
        self._tick_ns = np.zeros(ticks, dtype=np.int64)
        self._q = np.full((ticks, BASE_NQ + n), np.nan)
        self._v = np.full((ticks, BASE_NV + n), np.nan)
        self._effort = np.full((ticks, n), np.nan)
        self._command = np.full((ticks, n), np.nan)
        self._reference_ns = np.zeros(periods, dtype=np.int64)
        self._reference = np.full((2, periods, n), np.nan)  # position, velocity
        self._poses = np.full((2, len(arms), periods, 7), np.nan)  # target, tool
        self._deputy = np.full((periods, 7), np.nan)
        self._conserved = np.full((periods, 8), np.nan)  # momenta, kinetic energy, work
        self._ik_status = np.full(periods, -1, dtype=np.int64)
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []
        self._decisions: list[RunEvent] = []
        self._tick = 0
        self._period = 0

    def make_room(self, ticks: int, periods: int) -> None:
        """Grow to at least ``ticks`` states and ``periods`` references."""
        for name in ("_tick_ns", "_q", "_v", "_effort", "_command"):
            setattr(self, name, _longer(getattr(self, name), ticks, 0))
        for name in ("_reference_ns", "_deputy", "_conserved", "_ik_status"):
            setattr(self, name, _longer(getattr(self, name), periods, 0))
        self._reference, self._poses = _longer(self._reference, periods, 1), _longer(self._poses, periods, 2)

    def tick(self, stamp_ns: int, q: Array, v: Array, effort: Array, command: Array) -> None:
        """Add one tick: state, the efforts (n,) that led to it, and the command (n,) that answers it."""
        k = self._tick
        self._tick_ns[k] = stamp_ns
        self._q[k] = q
        self._v[k] = v
        self._effort[k] = effort
        self._command[k] = command
        self._tick += 1

    def reference(
        self,
        phase: TaskPhase,
        reference: JointReference,
        targets_in_world: Mapping[str, Pose],
        ik: IkStatus | None,
    ) -> None:
        """Add the output of the trajectory in one reference period; :meth:`plant` completes the row."""
        row = self._period
        self._reference_ns[row] = reference.stamp_ns
        self._reference[0, row] = reference.position
        self._reference[1, row] = reference.velocity
        for index, arm in enumerate(self._arms):
            _put(targets_in_world[arm], self._poses[0, index, row])
        if ik is not None:
            self._ik_status[row] = IK_STATUS_NUMBER[ik]
        self._phases.append(phase)
        self._period += 1

    def plant(
        self,
        tools_in_world: Mapping[str, Pose],
        deputy_in_world: Pose,
        conserved: ConservedQuantities,
        work: float,
    ) -> None:
        """Add the output of the plant in one reference period, before :meth:`reference`."""
        row = self._period
        for index, arm in enumerate(self._arms):
            _put(tools_in_world[arm], self._poses[1, index, row])
        _put(deputy_in_world, self._deputy[row])
        row_of = self._conserved[row]
        row_of[:3] = conserved.linear_momentum
        row_of[3:6] = conserved.angular_momentum
        row_of[6:] = conserved.kinetic_energy, work

    def events(self, events: Iterable[GraspEvent]) -> None:
        """Add grasp events."""
        self._events.extend(events)

    def decisions(self, events: Iterable[RunEvent]) -> None:
        """Add decisions about the task."""
        self._decisions.extend(events)

    def data(self) -> RunData:
        """Return the run so far."""
        ticks, periods = slice(self._tick), slice(self._period)

        def per_arm(kind: int) -> dict[str, Array]:
            return {arm: self._poses[kind, i, periods].copy() for i, arm in enumerate(self._arms)}

        return RunData(
            joint_names=self._joint_names,
            arms=self._arms,
            tick_ns=self._tick_ns[ticks].copy(),
            joint_position=self._q[ticks, BASE_NQ:].copy(),
            joint_velocity=self._v[ticks, BASE_NV:].copy(),
            joint_effort=self._effort[ticks].copy(),
            joint_command=self._command[ticks].copy(),
            base_pose=self._q[ticks, :BASE_NQ].copy(),
            base_twist=self._v[ticks, :BASE_NV].copy(),
            reference_ns=self._reference_ns[periods].copy(),
            reference_position=self._reference[0, periods].copy(),
            reference_velocity=self._reference[1, periods].copy(),
            target_pose=per_arm(0),
            tool_pose=per_arm(1),
            deputy_pose=self._deputy[periods].copy(),
            linear_momentum=self._conserved[periods, :3].copy(),
            angular_momentum=self._conserved[periods, 3:6].copy(),
            kinetic_energy=self._conserved[periods, 6].copy(),
            work=self._conserved[periods, 7].copy(),
            ik_status=self._ik_status[periods].copy(),
            phases=tuple(self._phases),
            grasp_events=tuple(self._events),
            run_events=tuple(self._decisions),
        )


def _put(pose: Pose, row: Array) -> None:
    """Write a pose into a row (7,): position, then quaternion x y z w."""
    row[:3] = pose.position
    row[3:] = pose.quaternion_xyzw


def _longer(array: npt.NDArray[N], size: int, axis: int) -> npt.NDArray[N]:
    """Return an array that has at least ``size`` rows along an axis; new ones are -1, no status of IK."""
    missing = [(0, max(size - length, 0) if place == axis else 0) for place, length in enumerate(array.shape)]
    return np.pad(array, missing, constant_values=array.dtype.type(-1)) if size > array.shape[axis] else array
