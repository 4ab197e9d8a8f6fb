"""Run recorder: collects the ticks of a run and returns them as arrays."""

from collections import defaultdict
from typing import Any

import numpy as np
import numpy.typing as npt

from sms_handover.graph.events import RunEvent
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.model.poses import pose_row, twist_in_deputy
from sms_handover.plan_report import PlannedPaths, PlanReport
from sms_handover.run_data import MeasuredRows, RunData
from sms_handover.simulation.observed_ticks import Period, Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.types import BASE_NQ, BASE_NV, Array, BaseWrench, GraspEvent, TaskPhase, TickRows

_BY_PERIOD = (
    *("reference_position", "reference_velocity", "deputy_pose", "deputy_twist"),
    *("linear_momentum", "angular_momentum", "kinetic_energy", "work", "external_work", "lost"),
    *("linear_impulse", "angular_impulse"),
)
_NONE = np.zeros(3)  # [N s], [N m s]
_NO_PANELS = np.zeros(0)
_NOT_ASKED = -1  # in place of a status where inverse kinematics was not asked
_GROWTH = 1.5  # [-] of the room for rows, where a run is longer than it was told


class RunRecorder:
    """A row per tick and a row per reference period, collected as the run goes on.

    Of a period only numbers, phase and events are kept, so that a long run stays small.
    """

    def __init__(
        self,
        joint_names: tuple[str, ...],
        arms: tuple[str, ...],
        ticks: int = 0,
        panel_names: tuple[str, ...] = (),
    ) -> None:
        """Start without a row, with room for so many ticks; for more it grows."""
        self._joint_names, self._arms, self._panel_names = joint_names, arms, panel_names
        n = len(joint_names)
        self._ends = np.cumsum([BASE_NQ + n, BASE_NV + n, n, n]).tolist()
        self._table = np.empty((ticks, self._ends[-1]))
        self._stamps: list[npt.NDArray[np.int64]] = []
        self._count = 0
        self._periods: defaultdict[str, list[Any]] = defaultdict(list)
        self._target_pose, self._tool_pose = ({arm: list[Array]() for arm in arms} for _ in range(2))
        self._phases: list[TaskPhase] = []
        self._events: list[GraspEvent] = []
        self._decisions: list[RunEvent] = []
        self._plans: list[PlanReport] = []
        self._paths: list[PlannedPaths] = []
        self._measured = list[Array]()  # by tick
        self._measured_deputy = list[Array]()  # by period

    def add(self, ticks: Ticks | QuietPeriods) -> None:
        """Add some ticks, and the reference periods that begin with them."""
        self._add_rows(ticks.rows)
        self._decisions.extend(ticks.excesses.get(0, ()))
        if isinstance(ticks, QuietPeriods):
            self._add_periods(ticks)
        elif ticks.period:
            self._add_period(ticks.period)
        if isinstance(ticks, Ticks) and ticks.plan:
            self._plans.append(ticks.plan)
        if isinstance(ticks, Ticks) and ticks.paths:
            self._paths.append(ticks.paths)
        for index, events in ticks.excesses.items():
            self._decisions.extend(events if index else ())

    def room(self, ticks: int) -> Array:
        """Return where the next rows of ticks are kept, for who writes them there and adds them next.

        A row (13 + 4 n,) is q, v, the efforts that acted, and those that answer, as in TickRows.
        """
        end = self._count + ticks
        if end > len(self._table):
            grown = np.empty((max(end, round(_GROWTH * len(self._table))), self._ends[-1]))
            grown[: self._count] = self._table[: self._count]
            self._table = grown
        return self._table[self._count : end]

    def _add_rows(self, rows: TickRows) -> None:
        """Add the rows of some ticks; those that were written where they belong are there."""
        if rows.q.base is not self._table:
            room = self.room(len(rows))
            columns = (rows.q, rows.v, rows.joint_effort, rows.effort)
            for start, end, values in zip((0, *self._ends), self._ends, columns, strict=False):
                room[:, start:end] = values
        self._count += len(rows)
        self._stamps.append(rows.stamp_ns)
        if rows.measured is not None:
            self._measured.append(rows.measured)

    def _add_period(self, period: Period) -> None:
        """Add what a reference period begins with."""
        reference, conserved, status = period.reference, period.conserved, period.ik_status
        given = period.external_impulse
        panels, deputy = period.panels, pose_row(period.deputy.deputy_in_world)
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
            "elastic_energy": panels.energy if panels else 0.0,
            "panel_position": panels.angle if panels else _NO_PANELS,
            "panel_velocity": panels.rate if panels else _NO_PANELS,
            "linear_impulse": _NONE if given is None else given.linear_impulse,
            "angular_impulse": _NONE if given is None else given.angular_impulse,
            "ik_status": CONSTANTS[status] if status else _NOT_ASKED,
        }
        for name, value in row.items():
            self._periods[name].append(np.array([value]))
        for arm in self._arms:
            self._target_pose[arm].append(pose_row(period.targets_in_world[arm])[np.newaxis])
            self._tool_pose[arm].append(pose_row(period.tools_in_world[arm])[np.newaxis])
        if period.measured:
            self._measured_deputy.append(pose_row(period.measured.deputy_in_world))
        self._phases.append(period.phase)
        self._events.extend(period.events)
        self._decisions.extend(period.decisions)

    def _add_periods(self, quiet: QuietPeriods) -> None:
        """Add what some reference periods begin with."""
        rows = quiet.periods
        for name in _BY_PERIOD:
            self._periods[name].append(getattr(rows, name))
        self._periods["reference_ns"].append(rows.stamp_ns)
        self._periods["elastic_energy"].append(np.zeros(len(rows.stamp_ns)))  # in C no panels swing
        for name in ("panel_position", "panel_velocity"):
            self._periods[name].append(np.zeros((len(rows.stamp_ns), 0)))
        status = [CONSTANTS[status] if status else _NOT_ASKED for status in rows.ik_status]
        self._periods["ik_status"].append(np.array(status))
        for arm in self._arms:
            self._target_pose[arm].append(rows.target_pose[arm])
            self._tool_pose[arm].append(rows.tool_pose[arm])
        self._phases.extend(quiet.phases)

    def data(self, base_wrenches: tuple[BaseWrench, ...] = (), applied: str = "") -> RunData:
        """Return the run so far, with the wrenches that others asked for, and what acts in the plant."""
        rows, (nq, nv, acted, _) = self._table[: self._count], self._ends
        return RunData(
            joint_names=self._joint_names,
            arms=self._arms,
            tick_ns=np.concatenate(self._stamps),
            joint_position=rows[:, BASE_NQ:nq],
            joint_velocity=rows[:, nq + BASE_NV : nv],
            joint_effort=rows[:, nv:acted],
            joint_command=rows[:, acted:],
            base_pose=rows[:, :BASE_NQ],
            base_twist=rows[:, nq : nq + BASE_NV],
            target_pose={arm: np.concatenate(rows) for arm, rows in self._target_pose.items()},
            tool_pose={arm: np.concatenate(rows) for arm, rows in self._tool_pose.items()},
            phases=tuple(self._phases),
            grasp_events=tuple(self._events),
            run_events=tuple(self._decisions),
            plans=tuple(self._plans),
            base_wrenches=base_wrenches,
            panel_names=self._panel_names,
            applied=applied,
            planned_paths=tuple(self._paths),
            measured=self._measured_rows(),
            **{name: np.concatenate(rows) for name, rows in self._periods.items()},
        )

    def _measured_rows(self) -> MeasuredRows | None:
        """Return what sensors have told, None without any."""
        if not self._measured:
            return None
        rows, nq = np.concatenate(self._measured), self._ends[0]
        return MeasuredRows(
            joint_position=rows[:, BASE_NQ:nq],
            joint_velocity=rows[:, nq + BASE_NV :],
            base_pose=rows[:, :BASE_NQ],
            base_twist=rows[:, nq : nq + BASE_NV],
            deputy_pose=np.array(self._measured_deputy),
        )
