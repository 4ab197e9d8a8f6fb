"""The predictive law in real time: plans that come late or not at all, and the process of the solver."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from select import select
from typing import Any

import numpy as np
import pytest

from sms_handover.control.mpc.controller import MpcController
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.plan import Plan
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.plan_queue import PlanQueue
from sms_handover.control.mpc.plan_solver import PlanSolver
from sms_handover.control.mpc.planner import Step
from sms_handover.control.mpc.real_time import MpcInRealTime
from sms_handover.errors import NoPlanError
from sms_handover.plan_report import PlanReport, PlanStatus
from sms_handover.simulation import loop as loop_module
from sms_handover.simulation import wiring
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.solver_process import SolverProcess
from sms_handover.types import BASE_NV, Array

TICK_NS, PERIOD_NS = 1_000_000, 20_000_000
HOLD = 3  # reference periods for which a plan is carried on
DEADLINE_S = 60.0  # s of wall time after which a test that waits has failed; nothing is measured by it


class Delayed:
    """Solves in this process, and answers when it has been asked as often as ``delay`` says of a plan."""

    def __init__(self, delay: Callable[[int], int], setup: Any) -> None:
        self._solver = PlanSolver(setup.robot, setup.deputy, setup.gains, setup.distances, None)
        self._delay = delay
        self.trouble = ""
        self.problems = list[PlanProblem]()
        self._left = dict[int, int]()

    def submit(self, problem: PlanProblem) -> None:
        self.problems.append(problem)
        self._left[problem.number] = self._delay(problem.number)

    def take(self) -> Step | None:
        problem = self.problems[-1]
        self._left[problem.number] -= 1
        return None if self._left[problem.number] else self._solver.solve(problem)

    def forget(self) -> None:
        self.problems = []

    def close(self) -> None:
        pass


Start = Callable[[Callable[[int], int]], Loop]


def scenario() -> Scenario:
    """The beginning of the paper's task; its first motion is under way at once."""
    return load_scenario("paper", {"controller": {"law": "mpc", "failed_plans": HOLD}})


@pytest.fixture
def in_real_time(monkeypatch: pytest.MonkeyPatch) -> Start:
    """What starts a loop as the controller node does in real time, with a solver of a given delay."""

    def start(delay: Callable[[int], int]) -> Loop:
        monkeypatch.setattr(wiring, "SolverProcess", partial(Delayed, delay))
        make = partial(wiring.make_controller, in_real_time=True)
        monkeypatch.setattr(loop_module, "make_controller", make)
        return Loop(scenario())

    return start


class Followed:
    """What a loop did tick by tick: reports, plans in use, joint rates and efforts."""

    def __init__(self, loop: Loop, ticks: int) -> None:
        self.reports = list[PlanReport]()
        self.plans = list[int]()
        rates, efforts, controller = list[Array](), list[Array](), loop.controller
        assert isinstance(controller, MpcController)
        for _ in range(ticks):
            tick = loop._advance(1)
            if tick.plan:
                self.reports.append(tick.plan)
            assert controller.plan is not None
            self.plans.append(controller.plan.number)
            rates.append(tick.rows.v[0, BASE_NV:])
            efforts.append(tick.rows.effort[0])
        self.rates, self.efforts = np.array(rates), np.array(efforts)


def plan(number: int, begin_ns: int) -> Plan:
    """Return a plan of two joints at rest."""
    return Plan(number, begin_ns, np.zeros(2), np.zeros(2), np.zeros((1, 2)), Horizon(np.ones(1)).intervals)


def test_plans_are_taken_by_number_and_counted_once_when_late() -> None:
    """One that comes after a later one is not used, whether that is in use or still to begin."""
    queue = PlanQueue()
    assert queue.offer(plan(0, 0)) and queue.plan is not None and queue.plan.number == 0
    assert queue.offer(plan(2, 50)) and not queue.offer(plan(1, 20))
    queue.advance(49)
    assert queue.plan.number == 0
    queue.advance(50)
    assert queue.plan.number == 2 and queue.coming is None
    assert not queue.offer(plan(2, 60)) and not queue.offer(plan(1, 60)) and queue.coming is None
    for stamp_ns in (70, 71, 72):
        queue.miss(3, 70, stamp_ns)
    assert queue.late == 1
    queue.miss(4, 90, 90)
    assert queue.late == 1


def test_a_solver_that_answers_in_time_changes_no_bit(in_real_time: Start) -> None:
    """Plans are made for the state a period ahead, so it does not matter when within it they come."""
    ticks = 100
    lock_step, live = Followed(Loop(scenario()), ticks), Followed(in_real_time(lambda number: 15), ticks)
    assert live.rates.tobytes() == lock_step.rates.tobytes()
    assert live.efforts.tobytes() == lock_step.efforts.tobytes()
    assert np.abs(live.rates).max() > 0.1
    for ours, theirs in zip(live.reports, lock_step.reports, strict=False):
        assert (ours.stamp_ns, ours.plan, ours.active) == (theirs.stamp_ns, theirs.plan, theirs.active)
        assert (ours.late_plans, ours.reused_plans) == (0, 0)


def test_late_plans_are_counted_and_used_in_order(in_real_time: Start) -> None:
    """Each takes one and a half periods: half of the periods have no plan of their own."""
    live = Followed(in_real_time(lambda number: 30), 200)
    assert [report.late_plans for report in live.reports] == [1, 2, 3, 4, 5]
    assert all(report.status is PlanStatus.SOLVED for report in live.reports)
    assert live.reports[-1].reused_plans == len(live.reports)
    assert live.plans == sorted(live.plans) and set(live.plans) == {0, 1, 2, 3, 4, 5}
    ages = [report.plan_age for report in live.reports[1:]]
    assert np.abs(live.rates).max() > 0.1 and ages == [-0.02] * len(ages)


def test_without_plans_the_arms_brake_and_an_old_plan_is_not_used(in_real_time: Start) -> None:
    """The seventh comes half a second late, when the arms have come to rest; then planning begins anew."""
    loop = in_real_time(lambda number: 500 if number == 7 else 10)
    live = Followed(loop, 800)
    robot = loop.scenario.model.robot
    stopped = [report for report in live.reports if report.status is PlanStatus.BRAKING]
    braking, stale = stopped
    begin = 6 * PERIOD_NS  # of the sixth plan, the last that came in time
    assert (braking.stamp_ns, braking.plan) == (begin + HOLD * PERIOD_NS, 8)
    assert stale.has_solve and not braking.has_solve
    assert braking.plan_age == pytest.approx(HOLD * PERIOD_NS / 1e9) and braking.late_plans == 1
    assert stale.plan == 7 and 7 not in live.plans and live.plans == sorted(live.plans)
    at, fastest = braking.stamp_ns // TICK_NS, np.abs(live.rates).max(axis=1)
    assert fastest[at] > 0.1 and fastest[at:].max() <= 1.001 * fastest[at] and fastest[at + 250] < 1e-3
    assert (np.abs(live.efforts) <= robot.effort_limit).all()
    assert live.reports[-1].status is PlanStatus.SOLVED and live.reports[-1].late_plans == 1
    assert fastest[-1] > 0.01


def test_without_a_solver_the_law_ends_once_the_arms_are_at_rest(in_real_time: Start) -> None:
    """In one line that says how the solver ended."""
    loop = in_real_time(lambda number: 1_000_000 if number > 6 else 10)
    before, controller = Followed(loop, 130), loop.controller
    assert isinstance(controller, MpcInRealTime) and np.abs(before.rates[-1]).max() > 0.1
    remote, trouble = controller._remote, "the solver process was ended by SIGKILL"
    assert isinstance(remote, Delayed)
    remote.trouble = trouble
    with pytest.raises(NoPlanError, match=rf"no plan .* at rest at .* s: {trouble}"):
        Followed(loop, 2000)
    assert np.abs(loop.state.joint_velocity).max() < 1e-4


_PARENT = """
import os, signal
from sms_handover.control.law import LawSetup
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.solver_process import SolverProcess
from sms_handover.simulation.wiring import gains_by_phase
s = load_scenario("paper", {"controller.law": "mpc"})
schedule = s.model.schedule
gains = gains_by_phase(schedule, s.parameters.controller)
print(SolverProcess(LawSetup(s.model.robot, gains, 1, deputy=schedule.deputy)).pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_process_of_the_solver_gives_the_same_bits_and_tells_its_end(
    in_real_time: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed, it is missed in one line."""
    started = list[Any]()

    class Kept(SolverProcess):
        def __init__(self, setup: Any) -> None:
            super().__init__(setup)
            started.append((self, setup))

    in_real_time(lambda number: 1)
    monkeypatch.setattr(wiring, "SolverProcess", Kept)
    loop = Loop(scenario())
    ((process, setup),) = started
    try:
        loop.advance()
        (answer,) = _answers(process, 1)
        here = PlanSolver(setup.robot, setup.deputy, setup.gains, setup.distances, None)
        delayed = in_real_time(lambda number: 1000)
        delayed.advance()
        (problem,) = delayed.controller._remote.problems  # type: ignore[attr-defined]
        assert answer.solution.change.tobytes() == here.solve(problem).solution.change.tobytes()
        process.submit(problem)
        process.forget()
        process.submit(problem)
        assert len(_answers(process, 1)) == 1  # that of the first is dropped
        os.kill(process.pid, signal.SIGKILL)
        process.submit(problem)
        assert _answers(process, 1) == [] and process.trouble == "the solver process was ended by SIGKILL"
    finally:
        process.close()


def _answers(process: SolverProcess, count: int) -> list[Step]:
    """Return so many answers, fewer if the process ends before."""
    found = list[Step]()
    while len(found) < count and not process.trouble:
        select([process._link.fileno()], [], [], DEADLINE_S)
        if (step := process.take()) is not None:
            found.append(step)
    return found


def test_the_solver_ends_with_the_process_that_started_it() -> None:
    """However that ends: here by SIGKILL."""
    parent = subprocess.run(
        [sys.executable, "-c", _PARENT], capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert parent.returncode == -signal.SIGKILL, parent
    try:
        handle = os.pidfd_open(int(parent.stdout))
    except ProcessLookupError:
        return  # it has ended already
    try:
        assert select([handle], [], [], DEADLINE_S)[0]
    finally:
        os.close(handle)
