"""Holm's adjustment of p values for their number [Holm1979]."""

from collections.abc import Sequence

from sms_handover.campaign.sampling.designs import needed


def holm(values: Sequence[float]) -> list[float]:
    """Return p values as Holm adjusts them: the chance of any false finding stays below the level of one.

    NaN, which stands for a test that could not be made, stays and counts for none. Raises
    MissingDependencyError without statsmodels.
    """
    made = [value for value in values if value == value]
    if not made:
        return list(values)
    adjusted = iter(
        needed("statsmodels.stats.multitest", "statsmodels").multipletests(made, method="holm")[1].tolist()
    )
    return [next(adjusted) if value == value else value for value in values]
