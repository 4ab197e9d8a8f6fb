"""Tables of a campaign with a column per law: success, percentiles, costs; and what tells laws apart."""

from collections.abc import Mapping, Sequence
from itertools import repeat
from math import nan

import numpy as np

from sms_handover.analysis.layout import MISSING, Row, Section, number
from sms_handover.campaign.cases.case_metrics import USUAL
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group
from sms_handover.campaign.statistics.holm import holm
from sms_handover.campaign.statistics.paired_tests import SUCCESS, PairedTest
from sms_handover.campaign.statistics.percentiles import percentile
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.sensitivity import CORRELATION, DESIGNED, Sensitivity, sensitivities

KEY_METRICS = (
    *("grasp_error", "grasp_angle", "grasp_speed", "clearance", "base_turn", "base_shift"),
    *("control_effort", "peak_torque", "rate_share", "time_beyond_position_limit"),
)
TESTED = ("grasp_error", "base_turn", "control_effort")
_MS_PER_S = 1000.0  # [ms/s]
_SHARES = ((0.05, "5 %"), (0.5, "median"), (0.95, "95 %"))


def outcome_sections(campaign: Campaign, columns: Mapping[Group, CaseColumns]) -> tuple[Section, ...]:
    """Return success, failures and percentiles of the metrics, a section per scenario."""
    return tuple(_scenario(campaign, name, columns) for name in campaign.scenarios)


def _scenario(campaign: Campaign, name: str, columns: Mapping[Group, CaseColumns]) -> Section:
    """Return the figures of all laws in a scenario."""
    found = [columns.get((name, law)) for law in campaign.laws]
    rows = [
        Row("cases", tuple(MISSING if one is None else str(len(one.case)) for one in found)),
        Row("success, 95 % interval", tuple(map(_success, found))),
        Row("mission failures", tuple(map(_mission, found))),
        Row("numeric failures", tuple(map(_numeric, found))),
    ]
    if all(one is None for one in found):
        return Section(f"Scenario {name}", tuple(rows))
    further = [metric for metric in campaign.metrics if metric not in KEY_METRICS]
    for metric in (*KEY_METRICS, *further):
        unit = f" [{USUAL[metric][0]}]" if metric in USUAL else ""
        rows.append(Row(f"{metric}{unit}", _known(found, metric)))
        if any(map(_count_known, found, repeat(metric))):
            for share, words in _SHARES:
                rows.append(Row(f"  {words}", tuple(_percentile(one, metric, share) for one in found)))
    rows.append(Row("CPU time of a case, mean [s]", tuple(map(_cpu, found))))
    if any(one is not None and not np.isnan(one.solve).all() for one in found):
        rows.append(Row("solve time of a plan, median [ms]", tuple(map(_solve, found))))
    return Section(f"Scenario {name}", tuple(rows))


def _known(found: Sequence[CaseColumns | None], metric: str) -> tuple[str, ...]:
    """Return how many cases have a metric, '' of those that all have; nothing if every law has it in all."""
    cells = []
    for one in found:
        known = _count_known(one, metric)
        every = 0 if one is None else len(one.case)
        cells.append(f"of {known} cases" if known < every else "")
    return tuple(cells) if any(cells) else ()


def _count_known(one: CaseColumns | None, metric: str) -> int:
    """Return how many cases of a law have a metric."""
    return 0 if one is None or metric not in one.metrics else int((~np.isnan(one.metrics[metric])).sum())


def _success(one: CaseColumns | None) -> str:
    return MISSING if one is None else str(proportion(int(one.succeeded.sum()), len(one.case)))


def _mission(one: CaseColumns | None) -> str:
    return MISSING if one is None else str(int((~one.succeeded & ~one.numeric_failure).sum()))


def _numeric(one: CaseColumns | None) -> str:
    return MISSING if one is None else str(int(one.numeric_failure.sum()))


def _cpu(one: CaseColumns | None) -> str:
    return MISSING if one is None or not one.cpu.size else number(float(one.cpu.mean()))


def _solve(one: CaseColumns | None) -> str:
    return MISSING if one is None else number(_MS_PER_S * percentile(one.solve, 0.5).value)


def _percentile(one: CaseColumns | None, metric: str, share: float) -> str:
    """Return a percentile with its interval."""
    if one is None or metric not in one.metrics:
        return MISSING
    found = percentile(one.metrics[metric], share)
    if np.isnan(found.value):
        return MISSING
    interval = "" if np.isnan(found.low) else f" [{number(found.low)}, {number(found.high)}]"
    return number(found.value) + interval


def paired_section(tests: Sequence[PairedTest]) -> Section | None:
    """Return the paired tests of the laws, None where there are none, as of one law only."""
    return Section("Paired tests of the laws", tuple(map(_test, tests))) if tests else None


TEST_HEAD = ("cases", "difference", "p", "p, Holm")


def _test(test: PairedTest) -> Row:
    """Return a test as a row."""
    what = "share of successes" if test.metric == SUCCESS else f"median of {test.metric}"
    label = f"{test.scenario}: {test.one} - {test.other}, {what}"
    return Row(label, (str(test.cases), *map(number, (test.difference, test.p, test.adjusted))))


SENSITIVITY_HEADS: Mapping[str, tuple[str, ...]] = {
    CORRELATION: ("Spearman's rho", "p", "p, Holm"),
    DESIGNED: ("Spearman's rho",),
    "morris": ("mu*", "95 % +-", "sigma"),
    "sobol": ("first order", "95 % +-", "total", "95 % +-"),
}


def sensitivity_sections(
    campaign: Campaign, columns: Mapping[Group, CaseColumns]
) -> tuple[tuple[tuple[str, ...], Section], ...]:
    """Return head and rows of the sensitivity of the worst-case metric, by scenario and law.

    p values of correlations are adjusted over all of them. What has too few cases for any is left out.
    """
    made = {group: sensitivities(campaign, one, campaign.worst_by) for group, one in columns.items()}
    every = [(group, one) for group, rows in made.items() for one in rows]
    adjusted = iter(holm([one.second if one.kind == CORRELATION else nan for _, one in every]))
    found = []
    for (scenario, law), rows in made.items():
        lines = tuple(_sensitivity(one, next(adjusted)) for one in rows)
        if any(one.first == one.first for one in rows):
            title = f"{campaign.worst_by} in {scenario} under {law}, by {rows[0].kind}"
            found.append((SENSITIVITY_HEADS[rows[0].kind], Section(title, lines)))
    return tuple(found)


def _sensitivity(one: Sensitivity, adjusted: float) -> Row:
    """Return the sensitivity to a drawn value as a row."""
    cells: Sequence[float] = {
        CORRELATION: (one.first, one.second, adjusted),
        DESIGNED: (one.first,),
        "morris": (one.first, one.first_half, one.second),
        "sobol": (one.first, one.first_half, one.second, one.second_half),
    }[one.kind]
    return Row(one.path, tuple(map(number, cells)))
