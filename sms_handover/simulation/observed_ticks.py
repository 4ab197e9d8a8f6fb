"""Observed ticks: what a loop tells of each tick and of each reference period."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from sms_handover.clearance.monitor import PeriodClearance
from sms_handover.control.protocol import Guidance
from sms_handover.graph.events import RunEvent
from sms_handover.model.conserved import ConservedQuantities
from sms_handover.plan_report import PlannedPaths, PlanReport
from sms_handover.plant.arm_part import PanelState
from sms_handover.plant.external_wrenches import ExternalAccount
from sms_handover.plant.sensed_plant import KnownState
from sms_handover.types import (
    Array,
    DeputyState,
    GraspEvent,
    IkStatus,
    JointReference,
    Pose,
    RobotState,
    TaskPhase,
    TickRows,
)


@dataclass(frozen=True, eq=False)
class Period:
    """What is worked out once per reference period, at the instant at which it begins.

    Tool poses and targets are in ``world``; since the start the joint efforts have done ``work`` J,
    wrenches from outside ``external_work`` J, and ``lost`` J have become heat; ``external_impulse`` is None
    where no such wrenches act, ``panels`` where none is on a hinge; ``ik_status`` is None where no tool had
    a target. ``events`` has what came of grasp commands, ``decisions`` what was decided about the task.
    ``clearance`` is None unless it is measured online, ``measured`` without sensors.
    """

    phase: TaskPhase
    reference: JointReference
    targets_in_world: Mapping[str, Pose]
    tools_in_world: Mapping[str, Pose]
    deputy: DeputyState
    conserved: ConservedQuantities
    work: float
    external_work: float
    lost: float
    external_impulse: ExternalAccount | None
    panels: PanelState | None
    ik_status: IkStatus | None
    events: tuple[GraspEvent, ...]
    decisions: tuple[RunEvent, ...]
    clearance: PeriodClearance | None = None
    measured: KnownState | None = None


class Observation(NamedTuple):
    """One tick: the state at ``stamp_ns``, and the efforts (n,) N m that answer it.

    ``q`` (7 + n,), ``v`` (6 + n,) and ``joint_effort`` (n,) are those of :attr:`state`. ``period`` is there
    at the instants at which a reference period begins. ``excesses`` tells of limits of the joints that were
    exceeded, once that is over.
    """

    stamp_ns: int
    q: Array
    v: Array
    joint_effort: Array
    effort: Array
    guidance: Guidance
    period: Period | None
    excesses: tuple[RunEvent, ...] = ()

    @property
    def phase(self) -> TaskPhase:
        """The phase in force."""
        return self.guidance.phase

    @property
    def reference(self) -> JointReference:
        """The joint reference in force."""
        return self.guidance.reference

    @property
    def state(self) -> RobotState:
        """The state that was answered."""
        return RobotState(self.stamp_ns, self.q, self.v, self.joint_effort)

    @property
    def events(self) -> tuple[GraspEvent, ...]:
        """What came of the grasp commands of this tick."""
        return self.period.events if self.period else ()


@dataclass(frozen=True, eq=False)
class Ticks:
    """Ticks under one guidance, as arrays; ``period`` is there if a reference period begins with them.

    ``excesses`` tells, by the number of the tick, of limits of the joints that were exceeded and of solves
    without a plan; ``plan`` is what came of the solve of a predictive law.
    """

    rows: TickRows
    excesses: Mapping[int, tuple[RunEvent, ...]]
    guidance: Guidance
    period: Period | None
    plan: PlanReport | None = None
    paths: PlannedPaths | None = None

    @property
    def phases(self) -> tuple[TaskPhase, ...]:
        """The phase of the reference period, if one begins with them."""
        return (self.period.phase,) if self.period else ()

    @property
    def observations(self) -> tuple[Observation, ...]:
        """The ticks one by one."""
        rows = self.rows
        columns = zip(rows.stamp_ns.tolist(), rows.q, rows.v, rows.joint_effort, rows.effort, strict=True)
        ticks = [
            Observation(*column, self.guidance, None, self.excesses.get(index, ()))
            for index, column in enumerate(columns)
        ]
        return (ticks[0]._replace(period=self.period), *ticks[1:])
