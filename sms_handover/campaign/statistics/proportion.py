"""Proportion of successes with Wilson's interval [Wilson1927]."""

from math import sqrt
from typing import NamedTuple

_Z = 1.959963984540054  # [-] the normal deviate of a two-sided 95 % interval


class Proportion(NamedTuple):
    """Successes among trials, and the bounds of Wilson's 95 % interval."""

    successes: int
    trials: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """The share of successes, NaN without a trial."""
        return self.successes / self.trials if self.trials else float("nan")

    @property
    def half_width(self) -> float:
        """Half the width of the interval."""
        return (self.high - self.low) / 2.0

    def __str__(self) -> str:
        if not self.trials:
            return "none yet"
        return f"{100 * self.share:.1f} % [{100 * self.low:.1f}, {100 * self.high:.1f}]"


def proportion(successes: int, trials: int) -> Proportion:
    """Return a proportion: its interval is about (p + z^2/2n) / (1 + z^2/n), [0, 1] without a trial.

    It holds the share in spite of rounding; its bound is 0 of no success, and 1 of successes only.
    """
    if trials == 0:
        return Proportion(successes, trials, 0.0, 1.0)
    share, spread = successes / trials, _Z**2 / trials
    centre = share + spread / 2.0
    half = _Z * sqrt(share * (1.0 - share) / trials + spread / (4.0 * trials))
    low, high = ((centre + sign * half) / (1.0 + spread) for sign in (-1.0, 1.0))
    low = 0.0 if successes == 0 else min(low, share)
    high = 1.0 if successes == trials else max(high, share)
    return Proportion(successes, trials, low, high)
