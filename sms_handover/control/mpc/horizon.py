"""Horizon of a plan: intervals that grow by a constant factor, and how the joints depend on accelerations."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, freeze

_HALVINGS = 200  # [-] of the interval that holds the factor of growth: more than a double resolves


@dataclass(frozen=True, eq=False)
class Horizon:
    """Intervals (N,) s between the N + 1 instants of a plan."""

    intervals: Array

    def __post_init__(self) -> None:
        freeze(self, "intervals")

    @classmethod
    def growing(cls, length: float, count: int, first: float) -> "Horizon":
        """Return ``count`` intervals from ``first`` s on that sum up to ``length`` s.

        first (1 + r + ... + r^(count-1)) = length, r by bisection. Raises ConfigurationError where r < 1.
        """
        if first * count > length:
            raise ConfigurationError(
                f"plan_first_interval is {first:g} s, must be <= plan_horizon / plan_intervals = "
                f"{length / count:g} s: intervals grow"
            )
        low, high = 1.0, 1.0 + length / first
        powers = np.arange(count)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            longer = first * float(np.sum(middle**powers)) > length
            low, high = (low, middle) if longer else (middle, high)
        return cls(np.asarray(first * low**powers, dtype=np.float64))

    @property
    def count(self) -> int:
        """The number of intervals N."""
        return len(self.intervals)

    @cached_property
    def times(self) -> Array:
        """The instants (N + 1,) s from the beginning of the plan."""
        return np.concatenate([[0.0], np.cumsum(self.intervals)])

    @cached_property
    def position_per_acceleration(self) -> Array:
        """The derivative (N + 1, N) s^2 of joint angles by the accelerations of the intervals, alike for all.

        Of interval j at instant k > j it is h_j (t_k - t_j) - h_j^2 / 2.
        """
        h, t = self.intervals, self.times
        after = t[:, None] > t[:-1] + 0.5 * h
        return np.where(after, h * (t[:, None] - t[:-1]) - 0.5 * h * h, 0.0)

    @cached_property
    def rate_per_acceleration(self) -> Array:
        """The derivative (N + 1, N) s of joint rates by the accelerations of the intervals: h_j once over."""
        h, t = self.intervals, self.times
        return np.where(t[:, None] > t[:-1] + 0.5 * h, h, 0.0)

    def motion(self, q: Array, w: Array, accelerations: Array) -> tuple[Array, Array]:
        """Return joint angles and rates (N + 1, n) from q, w (n,) under accelerations (N, n) rad/s^2."""
        rates = w + self.rate_per_acceleration @ accelerations
        angles = q + self.times[:, None] * w + self.position_per_acceleration @ accelerations
        return angles, rates
