"""Metrics of one run, for each phase and for the whole of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isnan, nan
from types import MappingProxyType

from sms_handover.analysis.base_motion import UNKNOWN_MOTION, BaseMotion, base_motion
from sms_handover.analysis.blocked_tools import BlockedTool, blocked_tools
from sms_handover.analysis.clearance import RunClearance, TaskTexts, run_clearance
from sms_handover.analysis.completion import Completion, completion
from sms_handover.analysis.conservation import IkOutcomes, PhysicsResiduals, ik_outcomes, physics_residuals
from sms_handover.analysis.joint_limits import LimitUse, limit_use
from sms_handover.analysis.loop_timing import LoopTiming, loop_timing
from sms_handover.analysis.numbers import largest
from sms_handover.analysis.phases import PhaseSpan, phase_spans
from sms_handover.analysis.plan_use import PlanUse, plan_use
from sms_handover.analysis.torque import JointTorque, joint_torque
from sms_handover.analysis.tracking import ToolTracking, tool_tracking
from sms_handover.analysis.work import JointWork, joint_work
from sms_handover.bag.run.loop_record import LoopRecord
from sms_handover.model.floating_model import floating_model
from sms_handover.run_data import RunData


@dataclass(frozen=True, eq=False)
class PhaseMetrics:
    """One phase: tracking of every arm, motion of the base, torques, work, conservation residuals."""

    phase: PhaseSpan
    tools: Mapping[str, ToolTracking]
    base: BaseMotion
    torque: JointTorque
    work: JointWork
    physics: PhysicsResiduals
    ik: IkOutcomes

    def __post_init__(self) -> None:
        object.__setattr__(self, "tools", MappingProxyType(dict(self.tools)))

    @property
    def settling_time(self) -> float:
        """Time in s from the start after which every tool stays in its band; NaN if one does not."""
        times = [tool.settling_time for tool in self.tools.values()]
        return max(times) if times and not any(map(isnan, times)) else nan


@dataclass(frozen=True, eq=False)
class RunMetrics:
    """One run: its phases in the order of time, and the figures of the whole run.

    ``loop`` is the timing of the run, None where it is not known; so are ``clearance`` and ``limits``
    where it is not known what the run was made with. ``plans`` is None unless its law plans.
    """

    run: RunData
    phases: tuple[PhaseMetrics, ...]
    torque: JointTorque
    work: JointWork
    physics: PhysicsResiduals
    ik: IkOutcomes
    loop: LoopTiming | None = None
    clearance: RunClearance | None = None
    limits: LimitUse | None = None
    plans: PlanUse | None = None

    @property
    def completion(self) -> Completion:
        """Whether the run did its task, and what it lacks."""
        return completion(self.run, self.clearance)

    @property
    def blocked(self) -> tuple[BlockedTool, ...]:
        """The tools off their targets at the end of a phase while a limit of a predictive law binds."""
        tools = [tool for item in self.phases for tool in item.tools.values()]
        return blocked_tools(self.run.plans, tools)

    def phase(self, name: str) -> PhaseMetrics | None:
        """Return the phase with a name, None if the run has none."""
        return next((item for item in self.phases if item.phase.name == name), None)

    def drift(self, name: str, begin: float) -> BaseMotion:
        """Return the motion of the base from ``begin`` s after the start of a phase to its end.

        Every figure is NaN if the run has no such phase, or its own tools have not settled by then.
        """
        found = self.phase(name)
        if found is None or not found.settling_time <= begin:
            return UNKNOWN_MOTION
        return base_motion(self.run, found.phase, begin)


def common_settling(runs: Iterable[RunMetrics], name: str) -> float:
    """Return the time in s after the start of a phase at which the slowest run has settled.

    Runs that do not settle in the phase, or lack it, are left out; NaN if no run remains.
    """
    found = [phase for phase in (run.phase(name) for run in runs) if phase is not None]
    return largest([phase.settling_time for phase in found])


def measure(run: RunData, loop: LoopRecord | None = None, texts: TaskTexts | None = None) -> RunMetrics:
    """Return all metrics of a run, given its wall-clock record and what it was made with, if known."""
    return RunMetrics(
        run=run,
        phases=tuple(_measure_phase(run, phase) for phase in phase_spans(run)),
        torque=joint_torque(run),
        work=joint_work(run),
        physics=physics_residuals(run),
        ik=ik_outcomes(run),
        loop=loop_timing(loop) if loop else None,
        clearance=run_clearance(run, texts) if texts else None,
        plans=plan_use(run),
        limits=limit_use(run, floating_model(texts.urdf)) if texts else None,
    )


def _measure_phase(run: RunData, phase: PhaseSpan) -> PhaseMetrics:
    return PhaseMetrics(
        phase,
        {arm: tool_tracking(run, phase, arm) for arm in run.arms},
        base_motion(run, phase),
        joint_torque(run, phase),
        joint_work(run, phase),
        physics_residuals(run, phase),
        ik_outcomes(run, phase),
    )
