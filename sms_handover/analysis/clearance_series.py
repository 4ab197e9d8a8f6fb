"""Clearance series: the least distance between groups of bodies over a run, for plots."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf

import numpy as np
import numpy.typing as npt

from sms_handover.clearance.worst_pair import WorstPair
from sms_handover.run_data import Stamps
from sms_handover.types import Array, read_only

Members = Iterable[tuple[int, npt.NDArray[np.bool_]]]  # a pair of a group, and when it counts to it


@dataclass(frozen=True, eq=False)
class GroupSeries:
    """The least signed distance (M,) m between two groups of bodies at each sampled reference period.

    It is NaN where the two are not looked at. ``margin`` m is the least distance beyond what was allowed.
    """

    name: str
    distance: Array
    margin: float


@dataclass(frozen=True, eq=False)
class ClearanceSeries:
    """The distances of all groups at the stamps (M,) of the reference periods, the worst group first.

    ``allowed`` m is 0 or less: what a declared contact may be deep, negated. ``worst_pair`` has the two
    bodies that are nearest at each stamp.
    """

    stamp_ns: Stamps
    groups: tuple[GroupSeries, ...]
    allowed: float
    worst_pair: WorstPair


class SeriesOfGroups:
    """Collects the series of a run, group by group; all stages of a contact are one series."""

    def __init__(self, sampled: Array) -> None:
        """Take the distances (M, pairs) m of all pairs at the reference periods."""
        self.sampled = sampled
        self.declared = np.zeros(sampled.shape, dtype=bool)  # where a contact is declared
        self.allowed = 0.0
        self._distances: dict[str, Array] = {}
        self._margins: dict[str, float] = {}

    def add(self, group: str, allowed: float, margin: float, members: Members) -> None:
        """Add the pairs of a group, which may be ``allowed`` m apart; negative in a declared contact."""
        name = group.partition(",")[0]  # what follows is the stage of a contact
        distance = self._distances.setdefault(name, np.full(len(self.sampled), np.nan))
        self._margins[name] = min(margin, self._margins.get(name, inf))
        self.allowed = min(self.allowed, allowed)
        for pair, rows in members:
            distance[rows] = np.fmin(distance[rows], self.sampled[rows, pair])
            if allowed < 0.0:
                self.declared[rows, pair] = True

    def groups(self) -> tuple[GroupSeries, ...]:
        """Return the series of every group, the worst one first."""
        found = [
            GroupSeries(name, read_only(distance), self._margins[name])
            for name, distance in self._distances.items()
        ]
        return tuple(sorted(found, key=lambda group: group.margin))
