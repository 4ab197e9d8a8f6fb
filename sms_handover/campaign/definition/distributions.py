"""Distributions of drawn values, each by its quantiles, so that random and designed samples share them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor
from statistics import NormalDist
from typing import Protocol

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, read_only

Value = float | int | str | bool
_STANDARD = NormalDist()
_TAIL = 0.001  # [-] probability on each side of the range that is printed


class Distribution(Protocol):
    """A distribution by its quantile function."""

    def quantile(self, share: float) -> Value:
        """Return the value below which lies a share in (0, 1) of all draws."""

    @property
    def options(self) -> tuple[Value, ...]:
        """All values where they are few, () where they fill a range."""

    def __str__(self) -> str:
        """Return it in words."""


@dataclass(frozen=True)
class Normal:
    """A normal distribution."""

    mean: float
    std: float

    options: tuple[Value, ...] = ()

    def quantile(self, share: float) -> float:
        """Return mean + std z with the standard normal quantile z; the mean itself without a spread."""
        return self.mean + self.std * _STANDARD.inv_cdf(share)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, std {self.std:g}"


@dataclass(frozen=True)
class Truncated:
    """A normal distribution of which only what is within bounds is drawn."""

    mean: float
    std: float
    low: float
    high: float

    options: tuple[Value, ...] = ()

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)
        if self.std == 0.0 and not self.low <= self.mean <= self.high:
            raise ConfigurationError(f"mean is {self.mean:g}, must be within [{self.low:g}, {self.high:g}]")
        if self.std and not self._shares[0] < self._shares[1]:
            raise ConfigurationError(
                f"bounds [{self.low:g}, {self.high:g}] are too far from the mean {self.mean:g}"
            )

    @property
    def _shares(self) -> tuple[float, float]:
        """The shares of the whole distribution that lie below the bounds."""
        low, high = (_STANDARD.cdf((bound - self.mean) / self.std) for bound in (self.low, self.high))
        return low, high

    def quantile(self, share: float) -> float:
        """Return the quantile of the part within the bounds."""
        if self.std == 0.0:
            return self.mean
        low, high = self._shares
        within = min(max(low + share * (high - low), _LEAST), 1.0 - _LEAST)
        return min(max(self.mean + self.std * _STANDARD.inv_cdf(within), self.low), self.high)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, std {self.std:g}, within [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class Uniform:
    """A uniform distribution."""

    low: float
    high: float

    options: tuple[Value, ...] = ()

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)

    def quantile(self, share: float) -> float:
        """Return low + share (high - low)."""
        return self.low + share * (self.high - self.low)

    def __str__(self) -> str:
        return f"uniform in [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class Choice:
    """One of some values, by their weights."""

    options: tuple[Value, ...]
    weights: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.options:
            raise ConfigurationError("a choice needs at least one value")
        if len(self.weights) != len(self.options):
            raise ConfigurationError(
                f"a choice of {len(self.options)} values has {len(self.weights)} weights: give one for each"
            )
        if not sum(self.weights) > 0.0:
            raise ConfigurationError("the weights of a choice must have a sum > 0")

    def quantile(self, share: float) -> Value:
        """Return the first value up to which the weights make more than a share of their sum."""
        left = share * sum(self.weights)
        for value, weight in zip(self.options, self.weights, strict=True):
            left -= weight
            if left < 0.0:
                return value
        return next(
            value for value, weight in zip(self.options[::-1], self.weights[::-1], strict=True) if weight
        )

    def __str__(self) -> str:
        return f"one of {', '.join(map(str, self.options))}"


@dataclass(frozen=True)
class Integers:
    """Whole numbers, all alike."""

    low: int
    high: int

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)

    @property
    def options(self) -> tuple[Value, ...]:
        """All of them, where they are few."""
        count = self.high - self.low + 1
        return tuple(range(self.low, self.high + 1)) if count <= _FEW else ()

    def quantile(self, share: float) -> int:
        """Return low + floor(share count)."""
        return min(self.low + floor(share * (self.high - self.low + 1)), self.high)

    def __str__(self) -> str:
        return f"whole number in [{self.low}, {self.high}]"


@dataclass(frozen=True, eq=False)
class Correlated:
    """Normal draws of several paths: mean + std L z with L L' the matrix of their correlations."""

    normals: dict[str, Normal]
    factor: Array

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """Return the value of each path from independent shares in (0, 1)."""
        mixed = self.factor @ np.array([_STANDARD.inv_cdf(share) for share in shares])
        drawn = zip(self.normals.items(), mixed.tolist(), strict=True)
        return {path: normal.mean + normal.std * deviate for (path, normal), deviate in drawn}


_FEW = 1000  # [-] whole numbers of which a grid takes each
_LEAST = 2.0**-53  # [-] a share nearer to 0 or 1 is that of an infinite quantile


def correlated(normals: dict[str, Normal], matrix: object) -> Correlated:
    """Return draws of a correlation matrix; raises ConfigurationError unless it is one."""
    size = len(normals)
    rows = matrix if isinstance(matrix, list) else []
    if len(rows) != size or not all(isinstance(row, list) and len(row) == size for row in rows):
        raise ConfigurationError(f"correlation must be {size} lists of {size} numbers")
    try:
        array = np.array(rows, dtype=np.float64)
        factor = np.linalg.cholesky(array)
    except (ValueError, TypeError, np.linalg.LinAlgError):
        raise ConfigurationError("correlation must be a positive definite matrix of numbers") from None
    if not (np.array_equal(array, array.T) and (np.diag(array) == 1.0).all()):
        raise ConfigurationError("correlation must be symmetric with 1 on its diagonal")
    return Correlated(normals, read_only(factor))


def range_in_words(distribution: Distribution) -> str:
    """Return the range that all but 0.2 % of the draws are in."""
    if distribution.options:
        return f"{len(distribution.options)} values"
    low, high = distribution.quantile(_TAIL), distribution.quantile(1.0 - _TAIL)
    return f"{low:.6g} to {high:.6g}"


def _require_order(low: float, high: float) -> None:
    """Raise ConfigurationError unless bounds are in order."""
    if low > high:
        raise ConfigurationError(f"low is {low:g}, must be <= high, which is {high:g}")
