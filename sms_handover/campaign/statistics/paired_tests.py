"""Paired tests of two laws over the cases that both have: McNemar, Wilcoxon, and Holm over all of them.

The draws of a case are the same under every law, so that what differs is the law's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import nan

import numpy as np

from sms_handover.campaign.sampling.designs import needed
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group
from sms_handover.campaign.statistics.holm import holm

SUCCESS = "success"


@dataclass(frozen=True)
class PairedTest:
    """A paired test of two laws in a scenario.

    Of success ``difference`` is that of the shares, and McNemar's exact test [McNemar1947] is made; of a
    metric it is the median of the differences, and Wilcoxon's signed-rank test [Wilcoxon1945]. ``p`` is
    NaN where no case tells the laws apart; ``adjusted`` is Holm's [Holm1979] over all tests.
    """

    scenario: str
    one: str
    other: str
    metric: str
    cases: int
    difference: float
    p: float
    adjusted: float = nan


def paired_tests(columns: Mapping[Group, CaseColumns], metrics: Sequence[str]) -> tuple[PairedTest, ...]:
    """Return the tests of every pair of laws in every scenario, of success and of some metrics.

    Raises MissingDependencyError without scipy and statsmodels.
    """
    found = []
    for scenario in dict.fromkeys(scenario for scenario, _ in columns):
        laws = [law for name, law in columns if name == scenario]
        for one, other in combinations(laws, 2):
            pair = columns[scenario, one], columns[scenario, other]
            found.append(_success(scenario, one, other, *pair))
            found += [_metric(scenario, one, other, *pair, metric) for metric in metrics]
    return _adjusted(found)


def _success(scenario: str, one: str, other: str, a: CaseColumns, b: CaseColumns) -> PairedTest:
    """Return McNemar's exact test of the successes of two laws."""
    rows, others = a.common(b)
    first, second = a.succeeded[rows], b.succeeded[others]
    only_first, only_second = int((first & ~second).sum()), int((~first & second).sum())
    p = nan
    if only_first + only_second:
        both, none = int((first & second).sum()), int((~first & ~second).sum())
        mcnemar = needed("statsmodels.stats.contingency_tables", "statsmodels").mcnemar
        p = float(mcnemar([[both, only_first], [only_second, none]], exact=True).pvalue)
    difference = float(first.mean() - second.mean()) if first.size else nan
    return PairedTest(scenario, one, other, SUCCESS, first.size, difference, p)


def _metric(scenario: str, one: str, other: str, a: CaseColumns, b: CaseColumns, metric: str) -> PairedTest:
    """Return Wilcoxon's signed-rank test of a metric under two laws, as he has it without pairs that agree.

    Left to SciPy, such pairs would make the test an approximation, however few they are.
    """
    rows, others = a.common(b)
    missing = np.full(0, nan)
    first, second = a.metrics.get(metric, missing), b.metrics.get(metric, missing)
    if not (first.size and second.size):
        return PairedTest(scenario, one, other, metric, 0, nan, nan)
    differences = first[rows] - second[others]
    differences = differences[~np.isnan(differences)]
    apart = differences[differences != 0.0]
    p = float(needed("scipy.stats", "scipy").wilcoxon(apart).pvalue) if apart.size else nan
    median = float(np.median(differences)) if differences.size else nan
    return PairedTest(scenario, one, other, metric, differences.size, median, p)


def _adjusted(tests: Sequence[PairedTest]) -> tuple[PairedTest, ...]:
    """Return tests with their p values adjusted for their number."""
    adjusted = holm([test.p for test in tests])
    return tuple(replace(test, adjusted=value) for test, value in zip(tests, adjusted, strict=True))
