"""Controller of the law ``mpc``: plans robot and base under constraints every reference period.

A plan begins one reference period after the state it is made for, which is predicted along the plan in use,
so that the result does not depend on how long a solve takes. Between solves the joints follow the plan by
computed torque. Nothing here waits for a clock: a solve that gives no plan leaves the one before in use. In
real time the solver has a process of its own: :mod:`sms_handover.control.mpc.real_time`.
"""

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import pinocchio as pin

from sms_handover.control.compensation import continued, memory_of, restore_memory
from sms_handover.control.law import LawSetup
from sms_handover.control.mpc.braking import braking_plan
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.momentum import base_start, base_velocity
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.patience import Patience, PatienceState
from sms_handover.control.mpc.plan import Plan
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.plan_queue import PlanQueue
from sms_handover.control.mpc.plan_solver import PlanSolver
from sms_handover.control.mpc.planner import PlanStart, Step, horizon_of
from sms_handover.control.mpc.prediction import PredictionModel
from sms_handover.control.mpc.quadratic_program import require_daqp
from sms_handover.control.protocol import Guidance
from sms_handover.errors import ConfigurationError
from sms_handover.model.known_payload import EMPTY_HANDS, Grip, KnownPayload
from sms_handover.plan_report import PlannedPaths, PlanReport, PlanStatus
from sms_handover.previewed_targets import PreviewState
from sms_handover.types import BASE_NQ, BASE_NV, Array, GraspEvent, frozen, read_only
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True, eq=False)
class MpcState:
    """Everything that later efforts depend on: plans, counts, the preview, and the initial attitude (3, 3).

    ``coming`` takes the place of ``plan`` when it begins; ``failures`` counts solves in a row without a plan,
    ``patience`` has what comes of that; ``news`` are grasps that count from the next state on, ``observed``
    is the memory of the compensation.
    """

    phase_index: int
    plan: Plan | None
    coming: Plan | None
    solves: int
    failures: int
    reused: int
    patience: PatienceState
    initial_rotation: Array
    preview: PreviewState | None
    grip: Grip
    news: tuple[GraspEvent, ...]
    observed: Array


class MpcController:
    """Plans every reference period and follows the plan; not thread-safe."""

    def __init__(self, setup: LawSetup[MpcGains]) -> None:
        """Set up the planners of all phases; raises ConfigurationError, MissingDependencyError."""
        require_daqp()
        if setup.preview is None or setup.distances is None:
            raise ConfigurationError(
                "control law 'mpc' needs a preview of targets and the distances of bodies"
            )
        self._gains, self._preview, self._make_efforts = setup.gains, setup.preview, setup.computed_torque
        self._solver = PlanSolver(
            setup.robot, setup.deputy, setup.gains, setup.distances, setup.compiled_derivatives
        )
        self._period_ns, self._queue = setup.reference_ns, PlanQueue()
        self._patience = Patience(setup.reference_ns)
        self._horizons: dict[MpcGains, Horizon] = {}
        self._efforts = self._make_efforts(setup.robot)
        self._payload = KnownPayload(setup.robot, setup.deputy)
        self._rest = read_only(np.zeros(setup.robot.n_joints))  # N m
        period = ns_to_seconds(setup.reference_ns)
        for gains in setup.gains:
            followed = (1 + gains.failed_plans) * period  # by the last plan before the arms brake
            if gains.plan_horizon < followed:
                raise ConfigurationError(
                    f"plan_horizon is {gains.plan_horizon:g} s, must be >= {followed:g} s, one reference "
                    f"period and failed_plans more of {period:g} s: so long a plan may have to be followed"
                )
            self._horizons[gains] = horizon_of(gains)  # rejects what cannot be planned with
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._preview.reset()
        self._phase_index = 0
        self._queue.restore(None, None, 0)
        self._solves = self._failures = 0
        self._patience.reset()
        self._initial_rotation: Array = np.zeros((3, 3))
        self._guidance: Guidance | None = None
        self._news: tuple[GraspEvent, ...] = ()
        self._hold(EMPTY_HANDS)
        restore_memory(self._efforts, np.zeros(0))
        self._report: PlanReport | None = None
        self._paths: PlannedPaths | None = None

    def guide(self, guidance: Guidance) -> None:
        """Plan for these targets at the next state."""
        self._guidance = guidance
        self._phase_index = guidance.phase.index

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m for a state, read-only; zero until first guidance has come.

        Raises NoPlanError when the arms are at rest where there is no plan again and again.
        """
        if self._news:
            self._heed_news(stamp_ns)
        self._queue.advance(stamp_ns)
        if self._guidance is not None:
            guidance, self._guidance = self._guidance, None
            if self._patience.is_over:
                self._give_up(stamp_ns, q, v, guidance)
            else:
                self._replan(stamp_ns, q, v, guidance)
        plan = self._queue.plan
        if plan is None:
            return self._rest
        gains = self._gains[self._phase_index]
        feedback = np.array([[gains.plan_position_gain], [gains.plan_velocity_gain]])
        every = np.repeat(feedback, self._robot.n_joints, axis=1)
        return frozen(self._robot.limited(self._efforts(q, v, plan.at(stamp_ns), every)))

    def grasped(self, event: GraspEvent) -> None:
        """Learn what came of a grasp command; it counts from the next state on."""
        self._news = (*self._news, event)

    def take_status(self) -> PlanReport | None:
        """Return the report of the solve since the last call, None if there was none."""
        report, self._report = self._report, None
        return report

    def take_paths(self) -> PlannedPaths | None:
        """Return the paths of the tools that are new since the last call, None if there are none."""
        paths, self._paths = self._paths, None
        return paths

    @property
    def plan(self) -> Plan | None:
        """The plan in use."""
        return self._queue.plan

    @property
    def state(self) -> MpcState:
        """Everything that later efforts depend on."""
        return MpcState(
            self._phase_index,
            self._queue.plan,
            self._queue.coming,
            self._solves,
            self._failures,
            self._queue.reused,
            self._patience.state,
            read_only(self._initial_rotation),
            self._preview.state,
            self._payload.grip,
            self._news,
            memory_of(self._efforts),
        )

    def restore(self, state: MpcState) -> None:
        """Go back to a former :attr:`state`."""
        self.reset()
        self._queue.restore(state.plan, state.coming, state.reused)
        self._phase_index, self._solves, self._failures = state.phase_index, state.solves, state.failures
        self._patience.restore(state.patience)
        self._initial_rotation = state.initial_rotation
        self._preview.restore(state.preview)
        self._news = state.news
        self._hold(state.grip)
        restore_memory(self._efforts, state.observed)

    def _heed_news(self, stamp_ns: int) -> None:
        """Take up the payload of the events before a state."""
        news = [event for event in self._news if event.stamp_ns < stamp_ns]
        self._news = self._news[len(news) :]
        for event in news:
            self._preview.grasped(event)
        if any([self._payload.grasped(event) for event in news]):
            self._hold(self._payload.grip)

    def _hold(self, grip: Grip) -> None:
        """Go on with the dynamics of the robot with what an arm holds."""
        self._payload.hold(grip)
        self._robot = self._payload.robot
        self._efforts = continued(self._make_efforts(self._robot), self._efforts)
        self._prediction = PredictionModel(self._robot)

    def _replan(self, stamp_ns: int, q: Array, v: Array, guidance: Guidance) -> None:
        """Make the plan of the next reference period."""
        begun = perf_counter()
        self._look_ahead(stamp_ns, q, v, guidance)
        problem = self._problem(stamp_ns, q, v)
        step = self._solver.solve(problem)
        status = self._use(step, problem)
        self._report = self._reported(problem, status, step, perf_counter() - begun)

    def _give_up(self, stamp_ns: int, q: Array, v: Array, guidance: Guidance) -> None:
        """Raise NoPlanError once the arms are at rest, with the limit that they exceed even there."""
        if self._patience.is_at_rest(stamp_ns, self._queue):
            self._look_ahead(stamp_ns, q, v, guidance)
            excess, row = self._solver.exceeded(self._problem(stamp_ns, q, v))
            raise self._patience.error(stamp_ns, excess, row)

    def _look_ahead(self, stamp_ns: int, q: Array, v: Array, guidance: Guidance) -> None:
        """Take guidance; the first plan of a run is to rest where the joints are."""
        if self._queue.plan is None:
            self._initial_rotation = np.array(pin.Quaternion(q[3:BASE_NQ]).normalized().matrix())
        self._preview.update(guidance.phase, guidance.reference, guidance.tool_in_world, q, v)
        if self._queue.plan is None:
            self._queue.offer(self._braking(self._here(q, v), 0, stamp_ns))

    def _problem(self, stamp_ns: int, q: Array, v: Array) -> PlanProblem:
        """Return the next problem: the plan that begins in a reference period."""
        plan = self._queue.plan
        assert plan is not None
        begin_ns, horizon = stamp_ns + self._period_ns, self._horizons[self._gains[self._phase_index]]
        start = self._start(plan, stamp_ns, q, v, begin_ns)
        accelerations = plan.resampled(horizon, begin_ns)
        stamps = [begin_ns + seconds_to_ns(time) for time in horizon.times[1:].tolist()]
        targets = tuple(self._preview.ahead(stamps))
        self._solves += 1
        return PlanProblem(
            self._solves,
            stamp_ns,
            begin_ns,
            self._phase_index,
            self._payload.grip,
            read_only(self._initial_rotation),
            start,
            accelerations,
            horizon.intervals,
            targets,
        )

    def _use(self, step: Step, problem: PlanProblem) -> PlanStatus:
        """Take over what a step gave: a plan, the one before, or one that brakes."""
        status, most = step.solution.status, self._gains[problem.phase_index].failed_plans
        if status is PlanStatus.SOLVED:
            self._failures = 0
            self._patience.solved(self._gains[problem.phase_index].plan_horizon)
            self._queue.offer(problem.plan(step))
            return status
        self._failures += 1
        self._queue.reused += 1
        if self._failures < most:
            return status
        if self._failures % most == 0:
            self._patience.brakes(step.solution)
        if self._failures == most:
            self._queue.offer(self._braking(problem.start, problem.number, problem.begin_ns))
        return PlanStatus.BRAKING

    def _here(self, q: Array, v: Array) -> PlanStart:
        """Return a state as where a plan begins."""
        return PlanStart(q[BASE_NQ:], v[BASE_NV:], base_start(self._robot, q, v))

    def _braking(self, start: PlanStart, number: int, begin_ns: int) -> Plan:
        """Return a plan that brings the joints to rest within the efforts that a plan may use."""
        limit = np.asarray(self._gains[self._phase_index].effort_share * self._robot.effort_limit)
        return braking_plan(self._prediction, start, limit, number, begin_ns)

    def _start(self, plan: Plan, stamp_ns: int, q: Array, v: Array, begin_ns: int) -> PlanStart:
        """Return where the next plan begins: the state of now, moved along the plan in use.

        What the joints are off from that plan they still are then; the base turns by the mean of its angular
        velocities now and then.
        """
        now, later = plan.at(stamp_ns), plan.at(begin_ns)
        base, period = base_start(self._robot, q, v), ns_to_seconds(begin_ns - stamp_ns)
        joints, rates = q[BASE_NQ:] + (later[0] - now[0]), v[BASE_NV:] + (later[1] - now[1])
        turned = base.rotation @ pin.exp3(period * v[3:BASE_NV])
        then = base_velocity(self._robot, replace(base, rotation=turned), joints, rates)
        rotation = base.rotation @ pin.exp3(0.5 * period * (v[3:BASE_NV] + then))
        centre = base.centre_of_mass + period / self._robot.mass * base.linear_momentum
        return PlanStart(joints, rates, replace(base, rotation=rotation, centre_of_mass=centre))

    def _reported(self, problem: PlanProblem, status: PlanStatus, step: Step, total: float) -> PlanReport:
        """Return the report of a solve that took so many seconds in all, and show its paths."""
        solution, plan = step.solution, self._queue.plan
        assert plan is not None
        if step.paths:
            self._paths = PlannedPaths(problem.stamp_ns, step.paths)
        return PlanReport(
            problem.stamp_ns,
            problem.number,
            status,
            solution.iterations,
            solution.active,
            solution.largest_slack,
            solution.largest_slack_row,
            solution.kkt_residual,
            step.linearization_time,
            step.program_time,
            total,
            ns_to_seconds(problem.stamp_ns - plan.begin_ns),
            self._queue.late,
            self._queue.reused,
        )
