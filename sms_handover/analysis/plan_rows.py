"""Plan rows: what a comparison and a report tell of the solves of a predictive law."""

from collections import Counter
from collections.abc import Sequence
from functools import partial

from sms_handover.analysis.layout import MISSING, Row, Section, row
from sms_handover.analysis.metrics import RunMetrics
from sms_handover.units import MM_PER_M

_MS_PER_S = 1000.0  # [ms/s]
_MOST_ROWS = 8  # [-] rows of constraints that are listed, those that bind most often
_PER_CENT = 100.0
_cost = partial(row, smaller_is_better=True)


def plan_sections(runs: Sequence[RunMetrics]) -> tuple[Section, ...]:
    """Return the section of plans, none if no run has any."""
    plans = [item.plans for item in runs]
    if not any(plans):
        return ()
    rows = [
        row("solves", plans, lambda item: item.solves),
        _cost("  without a plan", plans, lambda item: item.failed_solves),
        _cost("  an older plan carried on", plans, lambda item: item.reused_plans),
        _cost("  plans that came late", plans, lambda item: item.late_plans),
        _cost("solve time, median [ms]", plans, lambda item: item.solve_median * _MS_PER_S),
        _cost("  of it the quadratic program [ms]", plans, lambda item: item.program_median * _MS_PER_S),
        _cost("solve time, 99th percentile [ms]", plans, lambda item: item.solve_tail * _MS_PER_S),
        _cost("solve time, largest [ms]", plans, lambda item: item.solve_max * _MS_PER_S),
        row("solves in which a limit binds [%]", plans, lambda item: item.binding_share * _PER_CENT),
    ]
    total = Counter[str]()
    for item in plans:
        total.update(item.binding if item else {})
    for name, _ in total.most_common(_MOST_ROWS):
        cells = tuple(f"{item.binding.get(name, 0)}" if item else MISSING for item in plans)
        rows.append(Row(f"  {name}", cells))
    rows.append(_cost("largest excess of a soft limit, in its unit", plans, lambda item: item.largest_slack))
    rows.append(Row("  of", tuple((item.largest_slack_row or "none") if item else MISSING for item in plans)))
    rows += _blocked_rows(runs)
    return (Section("Plans of the predictive law", tuple(rows)),)


def _blocked_rows(runs: Sequence[RunMetrics]) -> list[Row]:
    """Return how far tools are off their targets at the end of a phase while a limit binds, if any is."""
    by_run = [{(item.phase, item.arm, item.row): item.error for item in run.blocked} for run in runs]
    keys = dict.fromkeys(key for errors in by_run for key in errors)
    rows = [Row("tools off their targets at the end of a phase while a limit binds [mm]")] if keys else []
    for key in keys:
        phase, arm, name = key
        cells = tuple(f"{errors[key] * MM_PER_M:.4g}" if key in errors else MISSING for errors in by_run)
        rows.append(Row(f"  {phase}, {arm}: {name}", cells))
    return rows
