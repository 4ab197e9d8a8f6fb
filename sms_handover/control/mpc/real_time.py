"""Real time of the law ``mpc``: its solver is another process, whose plans may come late or not at all.

What is given to the solver is the same as in lock step: the state one reference period ahead, predicted along
the plan in use. A plan that is not there when it is to begin is late and counted; the plan before is carried
on, for as long as ``failed_plans`` reference periods, and then the arms brake to rest from where they are. A
late plan is still used if nothing of a later number is there, at the instant that it has reached by then.
"""

from dataclasses import dataclass
from time import perf_counter

from sms_handover.control.law import LawSetup
from sms_handover.control.mpc.controller import MpcController
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.patience import no_plan
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.planner import Step
from sms_handover.control.protocol import Guidance
from sms_handover.errors import ConfigurationError
from sms_handover.plan_report import PlanReport, PlanStatus
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class _Awaited:
    """A problem that is being solved, and when it was sent, s of the wall clock."""

    problem: PlanProblem
    sent: float


class MpcInRealTime(MpcController):
    """Plans in another process and follows the plan; not thread-safe."""

    def __init__(self, setup: LawSetup[MpcGains]) -> None:
        """Start the solver; raises ConfigurationError, MissingDependencyError, SmsHandoverError."""
        if setup.start_solver is None:
            raise ConfigurationError("control law 'mpc' needs what starts its solver to run in real time")
        self._remote = setup.start_solver(setup)
        try:
            super().__init__(setup)
        except BaseException:
            self._remote.close()
            raise

    def reset(self) -> None:
        """Return to the start of a run; what is still being solved belongs to the run before."""
        super().reset()
        self._awaited: _Awaited | None = None
        self._brakes = False
        self._remote.forget()

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m for a state, read-only; zero until first guidance has come.

        Raises NoPlanError when the arms are at rest and the solver has ended, or there is no plan again and
        again.
        """
        self._queue.advance(stamp_ns)
        if self._awaited:
            self._hear(stamp_ns, self._awaited)
        self._brake_if_overdue(stamp_ns, q, v)
        if self._brakes and self.trouble and self._patience.is_at_rest(stamp_ns, self._queue):
            raise no_plan(stamp_ns, self.trouble)
        return super().effort(stamp_ns, q, v)

    @property
    def trouble(self) -> str:
        """How the solver has ended, '' while it runs."""
        return self._remote.trouble

    def close(self) -> None:
        """End the solver."""
        self._remote.close()

    def _hear(self, stamp_ns: int, awaited: _Awaited) -> None:
        """Take what has come of the problem that is being solved."""
        problem = awaited.problem
        self._queue.miss(problem.number, problem.begin_ns, stamp_ns)
        step = self._remote.take()
        if step is None:
            return
        self._awaited = None
        status = self._used(step, problem)
        self._queue.advance(stamp_ns)
        self._report = self._reported(problem, status, step, perf_counter() - awaited.sent)

    def _used(self, step: Step, problem: PlanProblem) -> PlanStatus:
        """Take over a plan that has come, unless the arms have begun to brake since it was asked for."""
        status = step.solution.status
        if status is PlanStatus.SOLVED and self._queue.offer(problem.plan(step)):
            self._brakes, self._failures = False, 0
            self._patience.solved(self._gains[problem.phase_index].plan_horizon)
            return status
        self._queue.reused += 1
        if status is not PlanStatus.SOLVED:
            self._failures += 1
            if self._failures % self._gains[problem.phase_index].failed_plans == 0:
                self._patience.brakes(step.solution)
        return PlanStatus.BRAKING if self._brakes else status

    def _brake_if_overdue(self, stamp_ns: int, q: Array, v: Array) -> None:
        """Brake once a plan has been in use for as long as one may be carried on."""
        plan = self._queue.plan
        longest_ns = self._gains[self._phase_index].failed_plans * self._period_ns
        if plan is None or self._queue.coming or self._brakes or stamp_ns < plan.begin_ns + longest_ns:
            return
        self._brakes = True
        self._solves += 1  # what has been asked for before is out of order from now on
        self._queue.offer(self._braking(self._here(q, v), self._solves, stamp_ns))
        since = ns_to_seconds(stamp_ns - plan.begin_ns)
        nothing = (0, (), 0.0, "", float("nan"), 0.0, 0.0, 0.0)  # was solved
        counts = self._queue.late, self._queue.reused
        self._report = PlanReport(stamp_ns, self._solves, PlanStatus.BRAKING, *nothing, since, *counts)

    def _replan(self, stamp_ns: int, q: Array, v: Array, guidance: Guidance) -> None:
        """Ask for the plan of the next reference period, unless the solver is still busy or has ended."""
        self._queue.advance(stamp_ns + self._period_ns)  # guidance a little early: the plan for it is there
        self._look_ahead(stamp_ns, q, v, guidance)
        if self._awaited or self.trouble:
            self._queue.reused += 1
            return
        problem = self._problem(stamp_ns, q, v)
        self._remote.submit(problem)
        self._awaited = _Awaited(problem, perf_counter())
