"""Designs that spread all cases together: rows of shares in (0, 1), a column per draw."""

import itertools
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from sms_handover.campaign.definition.distributions import Distribution
from sms_handover.campaign.definition.fields import GRID, LHS, MORRIS, MORRIS_LEVELS, SALTELLI, SOBOL
from sms_handover.errors import MissingDependencyError
from sms_handover.types import Array, read_only

_EDGE = 0.01  # [-] share that the outermost levels of morris keep from infinite quantiles
MORRIS_SPAN = 1.0 - 2.0 * _EDGE  # [-] share from the lowest to the highest level
_LEAST = 2.0**-53  # [-]


def design(kind: str, numbers: dict[str, int], cases: int | None, size: int, seed: int) -> Array:
    """Return the shares (cases, size) of a sampler of :mod:`scipy` or :mod:`SALib`.

    Raises MissingDependencyError without the extra ``campaign``.
    """
    if kind in (LHS, SOBOL):
        qmc = needed("scipy.stats.qmc", "scipy")
        make = qmc.LatinHypercube if kind == LHS else qmc.Sobol
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # balance of Sobol points, which check tells of
            shares = make(size, seed=np.random.default_rng(seed)).random(cases or 0)
    elif kind == MORRIS:
        levels = numbers.get("levels", MORRIS_LEVELS)
        sample = needed("SALib.sample.morris", "SALib").sample
        found = sample(problem(size), numbers["trajectories"], num_levels=levels, seed=seed)
        shares = _EDGE + MORRIS_SPAN * found
    elif kind == SALTELLI:
        sample = needed("SALib.sample.sobol", "SALib").sample
        shares = sample(problem(size), numbers["base"], calc_second_order=False, seed=seed)
    else:
        raise ValueError(f"{kind} is no design")
    return read_only(np.clip(np.asarray(shares, dtype=np.float64), _LEAST, 1.0 - _LEAST))


def grid(draws: Sequence[Distribution], levels: int) -> list[tuple[object, ...]]:
    """Return all combinations of the options of each draw, or of its quantiles (k + 1/2) / levels."""
    columns = [
        one.options or tuple(one.quantile((level + 0.5) / levels) for level in range(levels)) for one in draws
    ]
    return list(itertools.product(*columns))


def cases_of(kind: str, numbers: dict[str, int], draws: Sequence[Distribution]) -> int:
    """Return how many cases a design has that has its own number of them."""
    if kind == GRID:
        return int(np.prod([len(one.options) or numbers["levels"] for one in draws], dtype=object))
    if kind == MORRIS:
        return numbers["trajectories"] * (len(draws) + 1)
    return numbers["base"] * (len(draws) + 2)


def problem(size: int) -> dict[str, Any]:
    """Return factors as SALib describes them: shares in [0, 1]."""
    return {
        "num_vars": size,
        "names": [f"x{k}" for k in range(size)],
        "bounds": [[0.0, 1.0]] * size,
    }


def needed(module: str, package: str) -> Any:
    """Return a module of the extra; raises MissingDependencyError if it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            "this sampler and the statistics of a campaign", package, "campaign"
        ) from error
