"""Distributions of drawn values, each by its quantiles, so that random and designed samples share them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import erfc, floor, sqrt
from reprlib import repr as shortened
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


class Continuous:
    """A distribution that fills a range."""

    @property
    def options(self) -> tuple[Value, ...]:
        """None: its values are not few."""
        return ()


@dataclass(frozen=True)
class Normal(Continuous):
    """A normal distribution."""

    mean: float
    std: float

    def quantile(self, share: float) -> float:
        """Return mean + std z with the standard normal quantile z; the mean itself without a spread."""
        return self.mean + self.std * _STANDARD.inv_cdf(share)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, std {self.std:g}"


@dataclass(frozen=True)
class Truncated(Continuous):
    """A normal distribution of which only what is within bounds is drawn."""

    mean: float
    std: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)
        if self.std == 0.0 and not self.low <= self.mean <= self.high:
            raise ConfigurationError(f"mean is {self.mean:g}, must be within [{self.low:g}, {self.high:g}]")
        if self.std and not self._shares[1] - self._shares[0] >= _LEAST_WITHIN:
            raise ConfigurationError(
                f"bounds are [{self.low:g}, {self.high:g}], within which a draw with mean {self.mean:g} and "
                f"std {self.std:g} must be with a probability >= {_LEAST_WITHIN:g}: set them nearer to it"
            )

    @property
    def _is_mirrored(self) -> bool:
        """Whether both bounds are above the mean, where only the mirrored shares keep their digits."""
        return self.low > self.mean

    @property
    def _shares(self) -> tuple[float, float]:
        """The shares of the whole distribution, mirrored where that is needed, that lie below the bounds."""
        bounds = [(bound - self.mean) / self.std for bound in (self.low, self.high)]
        if self.low <= self.mean <= self.high:
            return _STANDARD.cdf(bounds[0]), _STANDARD.cdf(bounds[1])
        low, high = (-bounds[1], -bounds[0]) if self._is_mirrored else bounds
        return _tail(low), _tail(high)

    def quantile(self, share: float) -> float:
        """Return the quantile of the part within the bounds."""
        if self.std == 0.0:
            return self.mean
        (low, high), mirrored = self._shares, self._is_mirrored
        within = low + (1.0 - share if mirrored else share) * (high - low)
        deviate = _STANDARD.inv_cdf(min(max(within, _LEAST_WITHIN), 1.0 - _LEAST))
        value = self.mean + self.std * (-deviate if mirrored else deviate)
        return min(max(value, self.low), self.high)

    def __str__(self) -> str:
        return f"normal, mean {self.mean:g}, std {self.std:g}, within [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class Uniform(Continuous):
    """A uniform distribution."""

    low: float
    high: float

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

    values: tuple[Value, ...]
    weights: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise ConfigurationError("a choice has [] as values, must have at least one")
        if len(self.weights) != len(self.values):
            raise ConfigurationError(
                f"a choice of {len(self.values)} values has {len(self.weights)} weights: give one for each"
            )
        if not sum(self.weights) > 0.0:
            raise ConfigurationError(f"the weights of a choice are {list(self.weights)}, must have a sum > 0")

    @property
    def options(self) -> tuple[Value, ...]:
        """Those of its values that are ever drawn."""
        return tuple(value for value, weight in zip(self.values, self.weights, strict=True) if weight)

    def quantile(self, share: float) -> Value:
        """Return the first value up to which the weights make more than a share of their sum."""
        left = share * sum(self.weights)
        for value, weight in zip(self.values, self.weights, strict=True):
            left -= weight
            if left < 0.0:
                return value
        return self.options[-1]

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
_LEAST = 2.0**-53  # [-] a share nearer to 1 is that of an infinite quantile
_LEAST_WITHIN = 1e-300  # [-] share up to which quantiles of the lower tail have all their digits


def correlated(normals: dict[str, Normal], matrix: object) -> Correlated:
    """Return draws of a correlation matrix; raises ConfigurationError unless it is one."""
    size = len(normals)
    rows, told = matrix if isinstance(matrix, list) else [], f"correlation is {shortened(matrix)}, must be"
    if len(rows) != size or not all(isinstance(row, list) and len(row) == size for row in rows):
        raise ConfigurationError(f"{told} {size} lists of {size} numbers")
    try:
        array = np.array(rows, dtype=np.float64)
        factor = np.linalg.cholesky(array)
    except (ValueError, TypeError, np.linalg.LinAlgError):
        raise ConfigurationError(f"{told} a positive definite matrix of numbers") from None
    if not (np.array_equal(array, array.T) and (np.diag(array) == 1.0).all()):
        raise ConfigurationError(f"{told} symmetric with 1 on its diagonal")
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


def _tail(deviate: float) -> float:
    """Return the share of the standard normal distribution below a deviate <= 0, with all its digits."""
    return erfc(-deviate / sqrt(2.0)) / 2.0
