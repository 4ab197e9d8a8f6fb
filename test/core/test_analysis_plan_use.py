"""Use of plans: figures of the solves of a run, and of nothing that was not solved."""

from math import isnan

from sms_handover.analysis.plan_use import plan_use
from sms_handover.plan_report import PlanReport, PlanStatus

from .test_analysis_runs import make_run


def _plan(number: int, status: PlanStatus, program_time: float, total_time: float) -> PlanReport:
    active = ("effort of a",) if status is PlanStatus.SOLVED else ()
    times = (0.0, program_time, total_time, 0.0)
    return PlanReport(number, number, status, 1, active, 0.0, "", 0.0, *times, reused_plans=number)


BRAKES = _plan(4, PlanStatus.BRAKING, 0.0, 0.0)  # in real time, as plans are overdue: nothing was solved


def test_a_report_without_a_solve_is_in_no_figure_of_solves() -> None:
    """But in the counts that it carries."""
    solves = [_plan(1, PlanStatus.SOLVED, 0.002, 0.004), _plan(2, PlanStatus.BRAKING, 0.004, 0.006)]
    use = plan_use(make_run(end=0.04, plans=(*solves, BRAKES, BRAKES, BRAKES)))
    assert use is not None
    assert (use.solves, use.failed_solves, use.reused_plans, use.binding_share) == (2, 1, 4, 0.5)
    assert (use.solve_median, use.solve_max, use.program_median) == (0.005, 0.006, 0.003)
    assert 0.004 < use.solve_tail <= 0.006
    alone = plan_use(make_run(end=0.04, plans=(BRAKES,)))
    assert alone is not None and (alone.solves, alone.binding_share) == (0, 0.0) and isnan(alone.solve_median)


def test_a_run_without_plans_has_no_use_of_them() -> None:
    assert plan_use(make_run(end=0.04)) is None
