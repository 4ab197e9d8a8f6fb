"""Sensitivity of a metric to what is drawn: rank correlation, Morris' elementary effects, Sobol's indices."""

from dataclasses import dataclass
from math import nan

import numpy as np

from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.definition.fields import COUNTED, MORRIS, MORRIS_LEVELS, SALTELLI
from sms_handover.campaign.sampling.designs import MORRIS_SPAN, needed, problem
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.campaign.statistics.case_columns import CaseColumns

CORRELATION = "correlation"
DESIGNED = "correlation of a design"
FEWEST = 8  # [-] cases for a rank correlation
_SEED = 0  # of the resampling that gives the intervals


@dataclass(frozen=True)
class Sensitivity:
    """How much a metric depends on a drawn value; half widths of 95 % intervals, NaN where there are none.

    ``kind`` says which: ``correlation``, Spearman's, with its p value in ``second``, not adjusted for their
    number; ``correlation of a design``, the same without a p value, since cases of grid, morris, saltelli
    and list are no independent draws; ``morris``, mean magnitude mu* of the elementary effects and their
    spread sigma [Morris1991]; ``sobol``, first-order and total index [Saltelli2010].
    """

    path: str
    kind: str
    first: float
    first_half: float
    second: float
    second_half: float


def sensitivities(campaign: Campaign, columns: CaseColumns, metric: str) -> tuple[Sensitivity, ...]:
    """Return the sensitivity of a metric to each drawn value, by what the sampler of the campaign allows.

    Of morris and saltelli every case must have its metric; without that the rank correlation remains. Raises
    MissingDependencyError without scipy and SALib.
    """
    values = columns.metrics.get(metric)
    if values is None:
        return ()
    count = Samples(campaign).count
    whole = len(values) == count and not np.isnan(values).any() and np.ptp(values) > 0.0
    if whole and campaign.sampler.kind == MORRIS:
        return _morris(campaign, values)
    if whole and campaign.sampler.kind == SALTELLI:
        return _sobol(campaign, values)
    kind = CORRELATION if campaign.sampler.kind in COUNTED else DESIGNED
    return tuple(_correlation(kind, path, one, values) for path, one in columns.inputs.items())


def _correlation(kind: str, path: str, drawn: np.ndarray, values: np.ndarray) -> Sensitivity:
    """Return Spearman's rank correlation of a drawn value and a metric, with its p value if it has one."""
    known = ~(np.isnan(drawn) | np.isnan(values))
    if known.sum() < FEWEST or np.ptp(drawn[known]) == 0.0 or np.ptp(values[known]) == 0.0:
        return Sensitivity(path, kind, nan, nan, nan, nan)
    found = needed("scipy.stats", "scipy").spearmanr(drawn[known], values[known])
    p = float(found.pvalue) if kind == CORRELATION else nan
    return Sensitivity(path, kind, float(found.statistic), nan, p, nan)


def _morris(campaign: Campaign, values: np.ndarray) -> tuple[Sensitivity, ...]:
    """Return the elementary effects per unit of probability.

    SALib divides differences by the step of its own levels, from 0 to 1; those of a case span less.
    """
    paths, levels = campaign.paths, campaign.sampler.numbers.get("levels", MORRIS_LEVELS)
    analyze = needed("SALib.analyze.morris", "SALib").analyze
    found = analyze(problem(len(paths)), Samples(campaign).design, values, num_levels=levels, seed=_SEED)
    columns = (np.asarray(found[name]) / MORRIS_SPAN for name in ("mu_star", "mu_star_conf", "sigma"))
    rows = zip(paths, *columns, strict=True)
    return tuple(Sensitivity(path, "morris", float(m), float(c), float(s), nan) for path, m, c, s in rows)


def _sobol(campaign: Campaign, values: np.ndarray) -> tuple[Sensitivity, ...]:
    """Return first-order and total indices."""
    paths = campaign.paths
    analyze = needed("SALib.analyze.sobol", "SALib").analyze
    found = analyze(problem(len(paths)), values, calc_second_order=False, seed=_SEED)
    columns = (found[name] for name in ("S1", "S1_conf", "ST", "ST_conf"))
    rows = zip(paths, *columns, strict=True)
    return tuple(Sensitivity(path, "sobol", *map(float, numbers)) for path, *numbers in rows)
