"""Designs that spread all cases together: rows of shares in (0, 1), a column per draw."""

import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from sms_handover.campaign.definition.distributions import Distribution, Value
from sms_handover.campaign.definition.fields import LHS, MORRIS, MORRIS_LEVELS, SALTELLI, SOBOL
from sms_handover.errors import MissingDependencyError
from sms_handover.types import Array, read_only

_EDGE = 0.01  # [-] share that the outermost levels of morris keep from infinite quantiles
MORRIS_SPAN = 1.0 - 2.0 * _EDGE  # [-] share from the lowest to the highest level
_LEAST = 2.0**-53  # [-]
_HALF_CELL = 2.0**-31  # [-] Sobol's points are the lower corners of cells of 2^-30, of which one is 0


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
        shares = shares if kind == LHS else shares + _HALF_CELL
    elif kind == MORRIS:
        levels = numbers.get("levels", MORRIS_LEVELS)
        sample = needed("SALib.sample.morris", "SALib").sample
        found = sample(problem(size), numbers["trajectories"], num_levels=levels, seed=seed)
        shares = _EDGE + MORRIS_SPAN * found
    elif kind == SALTELLI:
        sample = needed("SALib.sample.sobol", "SALib").sample
        shares = sample(problem(size), numbers["base"], calc_second_order=False, seed=seed)
        shares = shares + _HALF_CELL
    else:
        raise ValueError(f"{kind} is no design")
    return read_only(np.clip(np.asarray(shares, dtype=np.float64), _LEAST, 1.0 - _LEAST))


def grid(draws: Sequence[Distribution], levels: int) -> list[tuple[Value, ...]]:
    """Return the values of each draw in a grid: its options, or its quantiles (k + 1/2) / levels."""
    return [
        one.options or tuple(one.quantile((level + 0.5) / levels) for level in range(levels)) for one in draws
    ]


def combination(columns: Sequence[Sequence[Value]], case: int) -> tuple[Value, ...]:
    """Return one of all combinations of values; that of the last column changes from case to case."""
    found = []
    for column in reversed(columns):
        case, index = divmod(case, len(column))
        found.append(column[index])
    return tuple(reversed(found))


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
