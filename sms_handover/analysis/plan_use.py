"""Use of the plans of a predictive law in a run: solves, what binds, slack, and how long solves took."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from types import MappingProxyType

import numpy as np

from sms_handover.plan_report import PlanStatus
from sms_handover.run_data import RunData

_TAIL = 99.0  # [%] percentile of the solve times that is reported


@dataclass(frozen=True, eq=False)
class PlanUse:
    """The solves of a run; reports without a solve are not among them.

    ``failed_solves`` gave no plan; ``reused_plans`` and ``late_plans`` are counts of periods and plans.
    ``binding_share`` of the solves have a row that binds, ``binding`` counts them by row. ``largest_slack``
    is of ``largest_slack_row``, in its unit. Solve times are s of wall time, of which ``program_median`` is
    the quadratic program's.
    """

    solves: float
    failed_solves: float
    reused_plans: float
    late_plans: float
    binding_share: float
    binding: Mapping[str, int]
    largest_slack: float
    largest_slack_row: str
    solve_median: float
    solve_tail: float
    solve_max: float
    program_median: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "binding", MappingProxyType(dict(self.binding)))


def plan_use(run: RunData) -> PlanUse | None:
    """Return the use of the plans of a run, None if its law made none."""
    plans = run.plans
    if not plans:
        return None
    solves = [plan for plan in plans if plan.has_solve]
    times = [plan.total_time for plan in solves] or [nan]
    worst = max(plans, key=lambda plan: plan.largest_slack)
    return PlanUse(
        solves=len(solves),
        failed_solves=sum(plan.status is not PlanStatus.SOLVED for plan in solves),
        reused_plans=plans[-1].reused_plans,
        late_plans=plans[-1].late_plans,
        binding_share=sum(bool(plan.active) for plan in solves) / max(1, len(solves)),
        binding=Counter(row for plan in solves for row in plan.active),
        largest_slack=worst.largest_slack,
        largest_slack_row=worst.largest_slack_row,
        solve_median=float(np.median(times)),
        solve_tail=float(np.percentile(times, _TAIL)),
        solve_max=max(times),
        program_median=float(np.median([plan.program_time for plan in solves] or [nan])),
    )
