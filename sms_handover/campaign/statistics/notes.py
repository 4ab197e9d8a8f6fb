"""Notes beside the statistics of a campaign: what intervals and p values mean, and what they cannot tell."""

from collections.abc import Sequence
from math import ceil, log2

from sms_handover.campaign.definition.campaign_file import StopRule
from sms_handover.campaign.definition.fields import GRID, LHS, LIST, MORRIS, SALTELLI, SOBOL
from sms_handover.campaign.statistics.paired_tests import PairedTest
from sms_handover.campaign.statistics.percentiles import least_cases

_LEVEL = 0.05  # [-] above which an adjusted p value tells nothing

PERCENTILES = (
    "Percentiles have 95 % intervals by order statistics, which hold for independent cases of any "
    f"distribution. Fewer cases than {least_cases(0.95)} have none of the 5 % and 95 % percentiles, fewer "
    f"than {least_cases(0.5)} none of the median either."
)
_SAMPLERS = {
    **dict.fromkeys(
        (SOBOL, LHS),
        "Cases of {} are spread evenly, not drawn independently, as intervals and p values have it: "
        "those are usually too wide and too large.",
    ),
    **dict.fromkeys(
        (GRID, MORRIS, SALTELLI),
        "Cases of {} are a design, not independent draws: shares, percentiles, their intervals and p values "
        "are those of the design, and say nothing of how often something happens.",
    ),
    LIST: "Cases are the rows of a table: intervals and p values hold if those are independent draws.",
}


def note_on_sampler(kind: str) -> str:
    """Return what intervals and p values mean for the cases of a sampler, '' of independent draws."""
    return _SAMPLERS.get(kind, "").format(kind)


def note_on_stop(rule: StopRule | None, stopped_at: int) -> str:
    """Return what intervals mean where a campaign may stop early, '' where it may not."""
    if rule is None:
        return ""
    looks = ", ".join(map(str, rule.looks))
    return (
        f"Stopping early makes an interval too narrow: it was looked at only after {looks} cases, to stop at "
        f"a half width of {rule.half_width:g}. "
        + (f"It stopped after {stopped_at}." if stopped_at else "It has not stopped early.")
    )


def note_on_tests(tests: Sequence[PairedTest]) -> str:
    """Return that there are too few cases for any of some tests to tell laws apart, '' if there are not.

    Of n pairs the least p value of both tests is 2^(1 - n), where all of them differ and favour one law; of m
    tests Holm's adjustment makes it m 2^(1 - n).
    """
    made = [test.cases for test in tests if test.p == test.p]
    if not made:
        return ""
    least = 2.0 ** (1 - max(made))
    adjusted = min(1.0, len(made) * least)
    if adjusted <= _LEVEL:
        return ""
    enough = 1 + ceil(log2(len(made) / _LEVEL))
    return (
        f"These tests cannot tell laws apart: {max(made)} cases have no p value below {least:.2g}, adjusted "
        f"for {len(made)} tests none below {adjusted:.2g}. From {enough} cases on they can."
    )
