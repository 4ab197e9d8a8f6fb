"""Pareto front: the cases of which no other is better in every respect."""

import numpy as np
import numpy.typing as npt

from sms_handover.types import Array


def pareto_front(costs: Array) -> npt.NDArray[np.bool_]:
    """Return which rows of costs (N, m) no other row is better than in one of them and as good in the rest.

    A row with NaN is on no front.
    """
    front = np.zeros(len(costs), dtype=np.bool_)
    known = np.flatnonzero(~np.isnan(costs).any(axis=1))
    kept: list[int] = []
    for row in known[
        np.lexsort(costs[known].T[::-1])
    ]:  # by the first cost: what dominates a row comes before it
        best = costs[kept]
        if not (np.all(best <= costs[row], axis=1) & np.any(best < costs[row], axis=1)).any():
            kept.append(int(row))
    front[kept] = True
    return front
