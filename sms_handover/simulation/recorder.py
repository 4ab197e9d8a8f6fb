"""Run recorder: collects the ticks of a run and returns them as arrays."""

import numpy as np

from sms_handover.graph.events import RunEvent
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.model.poses import pose_row
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Observation, Period
from sms_handover.types import BASE_NQ, BASE_NV, Array, GraspEvent, Pose

_NOT_ASKED = -1  # in place of a status where inverse kinematics was not asked


class RunRecorder:
    """Arrays with a row per tick, filled as the run goes on; the periods are kept as they are."""

    def __init__(self, joint_names: tuple[str, ...], arms: tuple[str, ...], ticks: int) -> None:
        """Make room for ``ticks`` states; more make more room."""
        n = len(joint_names)
        self._joint_names, self._arms = joint_names, arms
        stamps = np.zeros(ticks, dtype=np.int64)
        widths = (BASE_NQ + n, BASE_NV + n, n, n)  # of q, v, the efforts that acted, and those that answer
        self._rows = [stamps, *(np.full((ticks, width), np.nan) for width in widths)]
        self._count = 0
        self._periods: list[Period] = []

    def add(self, tick: Observation) -> None:
        """Add one tick."""
        k = self._count
        if k == len(self._rows[0]):
            self._rows = [np.concatenate([rows, np.zeros_like(rows)]) for rows in self._rows]
        stamps, q, v, effort, command = self._rows
        stamps[k] = tick.stamp_ns
        q[k] = tick.q
        v[k] = tick.v
        effort[k] = tick.joint_effort
        command[k] = tick.effort
        self._count += 1
        if tick.period:
            self._periods.append(tick.period)

    def data(self) -> RunData:
        """Return the run so far."""
        stamps, q, v, effort, command = (rows[: self._count] for rows in self._rows)
        periods = self._periods
        events: list[GraspEvent] = [event for period in periods for event in period.events]
        decisions: list[RunEvent] = [event for period in periods for event in period.decisions]
        status = [CONSTANTS[p.ik_status] if p.ik_status else _NOT_ASKED for p in periods]
        return RunData(
            joint_names=self._joint_names,
            arms=self._arms,
            tick_ns=stamps.copy(),
            joint_position=q[:, BASE_NQ:].copy(),
            joint_velocity=v[:, BASE_NV:].copy(),
            joint_effort=effort.copy(),
            joint_command=command.copy(),
            base_pose=q[:, :BASE_NQ].copy(),
            base_twist=v[:, :BASE_NV].copy(),
            reference_ns=np.array([period.reference.stamp_ns for period in periods], dtype=np.int64),
            reference_position=np.array([period.reference.position for period in periods]),
            reference_velocity=np.array([period.reference.velocity for period in periods]),
            target_pose={arm: _poses([p.targets_in_world[arm] for p in periods]) for arm in self._arms},
            tool_pose={arm: _poses([p.tools_in_world[arm] for p in periods]) for arm in self._arms},
            deputy_pose=_poses([period.deputy.deputy_in_world for period in periods]),
            linear_momentum=np.array([period.conserved.linear_momentum for period in periods]),
            angular_momentum=np.array([period.conserved.angular_momentum for period in periods]),
            kinetic_energy=np.array([period.conserved.kinetic_energy for period in periods]),
            work=np.array([period.work for period in periods]),
            ik_status=np.array(status, dtype=np.int64),
            phases=tuple(period.phase for period in periods),
            grasp_events=tuple(events),
            run_events=tuple(decisions),
        )


def _poses(poses: list[Pose]) -> Array:
    """Return poses as rows: position, then quaternion x y z w."""
    return np.array([pose_row(pose) for pose in poses])
