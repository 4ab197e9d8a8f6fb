"""Run recorder: collects the ticks of a run and returns them as arrays."""

from collections import defaultdict
from typing import Any

import numpy as np

from sms_handover.graph.events import RunEvent
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.model.poses import pose_row, twist_in_deputy
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Period, Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.types import BASE_NQ, BASE_NV, Array, GraspEvent, TaskPhase, TickRows

_BY_PERIOD = (
    *("reference_position", "reference_velocity", "deputy_pose", "deputy_twist"),
    *("linear_momentum", "angular_momentum", "kinetic_energy", "work", "external_work", "lost"),
)
_NOT_ASKED = -1  # in place of a status where inverse kinematics was not asked


class RunRecorder:
    """A row per tick and a row per reference period, collected as the run goes on.

    Of a period only numbers, phase and events are kept, so that a long run stays small.
    """

    def __init__(self, joint_names: tuple[str, ...], arms: tuple[str, ...]) -> None:
        """Start without a row."""
        self._joint_names, self._arms = joint_names, arms
        self._rows: list[TickRows] = []
        self._periods: defaultdict[str, list[Any]] = defaultdict(list)
        self._target_pose, self._tool_pose = ({arm: list[Array]() for arm in arms} for _ in range(2))
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []
        self._decisions: list[RunEvent] = []

    def add(self, ticks: Ticks | QuietPeriods) -> None:
        """Add some ticks, and the reference periods that begin with them."""
        self._rows.append(ticks.rows)
        self._decisions.extend(ticks.excesses.get(0, ()))
        if isinstance(ticks, QuietPeriods):
            self._add_periods(ticks)
        elif ticks.period:
            self._add_period(ticks.period)
        for index, events in ticks.excesses.items():
            self._decisions.extend(events if index else ())

    def _add_period(self, period: Period) -> None:
        """Add what a reference period begins with."""
        reference, conserved, status = period.reference, period.conserved, period.ik_status
        deputy = pose_row(period.deputy.deputy_in_world)
        row = {
            "reference_ns": reference.stamp_ns,
            "reference_position": reference.position,
            "reference_velocity": reference.velocity,
            "deputy_pose": deputy,
            "deputy_twist": twist_in_deputy(deputy, period.deputy.twist_deputy_in_world.row),
            "linear_momentum": conserved.linear_momentum,
            "angular_momentum": conserved.angular_momentum,
            "kinetic_energy": conserved.kinetic_energy,
            "work": period.work,
            "external_work": period.external_work,
            "lost": period.lost,
            "ik_status": CONSTANTS[status] if status else _NOT_ASKED,
        }
        for name, value in row.items():
            self._periods[name].append(np.array([value]))
        for arm in self._arms:
            self._target_pose[arm].append(pose_row(period.targets_in_world[arm])[np.newaxis])
            self._tool_pose[arm].append(pose_row(period.tools_in_world[arm])[np.newaxis])
        self._phases.append(period.phase)
        self._events.extend(period.events)
        self._decisions.extend(period.decisions)

    def _add_periods(self, quiet: QuietPeriods) -> None:
        """Add what some reference periods begin with."""
        rows = quiet.periods
        for name in _BY_PERIOD:
            self._periods[name].append(getattr(rows, name))
        self._periods["reference_ns"].append(rows.stamp_ns)
        status = [CONSTANTS[status] if status else _NOT_ASKED for status in rows.ik_status]
        self._periods["ik_status"].append(np.array(status))
        for arm in self._arms:
            self._target_pose[arm].append(rows.target_pose[arm])
            self._tool_pose[arm].append(rows.tool_pose[arm])
        self._phases.extend(quiet.phases)

    def data(self) -> RunData:
        """Return the run so far."""
        rows = self._rows
        return RunData(
            joint_names=self._joint_names,
            arms=self._arms,
            tick_ns=np.concatenate([part.stamp_ns for part in rows]),
            joint_position=np.concatenate([part.q[:, BASE_NQ:] for part in rows]),
            joint_velocity=np.concatenate([part.v[:, BASE_NV:] for part in rows]),
            joint_effort=np.concatenate([part.joint_effort for part in rows]),
            joint_command=np.concatenate([part.effort for part in rows]),
            base_pose=np.concatenate([part.q[:, :BASE_NQ] for part in rows]),
            base_twist=np.concatenate([part.v[:, :BASE_NV] for part in rows]),
            target_pose={arm: np.concatenate(rows) for arm, rows in self._target_pose.items()},
            tool_pose={arm: np.concatenate(rows) for arm, rows in self._tool_pose.items()},
            phases=tuple(self._phases),
            grasp_events=tuple(self._events),
            run_events=tuple(self._decisions),
            **{name: np.concatenate(rows) for name, rows in self._periods.items()},
        )
