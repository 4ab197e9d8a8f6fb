"""Run recorder: collects the ticks of a run and returns them as arrays."""

from collections import defaultdict
from typing import Any

import numpy as np

from sms_handover.graph.events import RunEvent
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.model.poses import pose_row
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Observation, Period
from sms_handover.types import BASE_NQ, BASE_NV, Array, GraspEvent, TaskPhase

_NOT_ASKED = -1  # in place of a status where inverse kinematics was not asked


class RunRecorder:
    """A row per tick and a row per reference period, collected as the run goes on.

    Of a period only numbers, phase and events are kept, so that a long run stays small.
    """

    def __init__(self, joint_names: tuple[str, ...], arms: tuple[str, ...], ticks: int) -> None:
        """Make room for ``ticks`` states; more make more room."""
        n = len(joint_names)
        self._joint_names, self._arms = joint_names, arms
        stamps = np.zeros(ticks, dtype=np.int64)
        widths = (BASE_NQ + n, BASE_NV + n, n, n)  # of q, v, the efforts that acted, and those that answer
        self._rows = [stamps, *(np.full((ticks, width), np.nan) for width in widths)]
        self._count = 0
        self._periods: defaultdict[str, list[Any]] = defaultdict(list)
        self._target_pose, self._tool_pose = ({arm: list[Array]() for arm in arms} for _ in range(2))
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []
        self._decisions: list[RunEvent] = []

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
        if tick.excesses:
            self._decisions.extend(tick.excesses)
        if tick.period:
            self._add_period(tick.period)

    def _add_period(self, period: Period) -> None:
        """Add what a reference period begins with."""
        reference, conserved, status = period.reference, period.conserved, period.ik_status
        row = {
            "reference_ns": reference.stamp_ns,
            "reference_position": reference.position,
            "reference_velocity": reference.velocity,
            "deputy_pose": pose_row(period.deputy.deputy_in_world),
            "linear_momentum": conserved.linear_momentum,
            "angular_momentum": conserved.angular_momentum,
            "kinetic_energy": conserved.kinetic_energy,
            "work": period.work,
            "ik_status": CONSTANTS[status] if status else _NOT_ASKED,
        }
        for name, value in row.items():
            self._periods[name].append(value)
        for arm in self._arms:
            self._target_pose[arm].append(pose_row(period.targets_in_world[arm]))
            self._tool_pose[arm].append(pose_row(period.tools_in_world[arm]))
        self._phases.append(period.phase)
        self._events.extend(period.events)
        self._decisions.extend(period.decisions)

    def data(self) -> RunData:
        """Return the run so far."""
        stamps, q, v, effort, command = (rows[: self._count] for rows in self._rows)
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
            target_pose={arm: np.array(rows) for arm, rows in self._target_pose.items()},
            tool_pose={arm: np.array(rows) for arm, rows in self._tool_pose.items()},
            phases=tuple(self._phases),
            grasp_events=tuple(self._events),
            run_events=tuple(self._decisions),
            **{name: np.array(rows) for name, rows in self._periods.items()},
        )
