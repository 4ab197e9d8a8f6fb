"""The worst pair of bodies at each instant of a run, with the points at which the two are nearest."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sms_handover.clearance.contacts import may_touch
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.run_data import Stamps
from sms_handover.types import Array, read_only


@dataclass(frozen=True, eq=False)
class WorstPair:
    """The two bodies that are nearest to each other at each of M instants, outside allowed contact.

    ``distance`` (M,) m is signed, ``points_in_world`` (M, 2, 3) m lie on the first and the second body of
    ``bodies[pair]``, where ``pair`` (M,) is an index. A contact that is declared counts only where it is
    deeper than allowed; where nothing counts, numbers are NaN and the index is 0.
    """

    stamp_ns: Stamps
    bodies: tuple[tuple[str, str], ...]
    pair: npt.NDArray[np.int64]
    distance: Array
    points_in_world: Array

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ("stamp_ns", "pair"):
            getattr(self, name).setflags(write=False)
        for name in ("distance", "points_in_world"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def at(self, stamp_ns: Stamps) -> "WorstPair":
        """Return the same at other instants; numbers are NaN at those that are not among ours."""
        rows = np.minimum(np.searchsorted(self.stamp_ns, stamp_ns), max(len(self.stamp_ns) - 1, 0))
        known = self.stamp_ns[rows] == stamp_ns if len(self.stamp_ns) else np.zeros(len(rows), dtype=bool)
        pair, distance = np.zeros(len(rows), dtype=np.int64), np.full(len(rows), np.nan)
        points = np.full((len(rows), 2, 3), np.nan)
        pair[known], distance[known] = self.pair[rows[known]], self.distance[rows[known]]
        points[known] = self.points_in_world[rows[known]]
        return WorstPair(stamp_ns, self.bodies, pair, distance, points)


class NearestRecord:
    """Keeps the nearest points of the pairs that may turn out to be the worst, instant by instant.

    These are the nearest of all pairs that must not touch, and every gripper with the deputy, of which only
    the rest of the run tells whether their contact was declared.
    """

    def __init__(self, model: ClearanceModel) -> None:
        """Begin an empty record of a model."""
        self._model = model
        touching = [may_touch(*pair) for pair in model.pairs]
        self._touching = [int(pair) for pair in np.flatnonzero(touching)]
        self._others = np.flatnonzero(np.logical_not(touching))
        self._kept: list[list[int]] = []
        self._points: list[list[Array]] = []

    def keep(self, distances: Array) -> None:
        """Keep an instant, whose ``distances`` (pairs,) m the model has just measured."""
        kept = list(self._touching)
        if self._others.size:
            kept.append(int(self._others[distances[self._others].argmin()]))
        self._kept.append(kept)
        self._points.append([self._model.nearest_points(pair).points_in_world for pair in kept])

    def worst(
        self, stamp_ns: Stamps, distances: Array, declared: npt.NDArray[np.bool_], contact_depth: float
    ) -> WorstPair:
        """Return the worst pair of each instant kept.

        ``distances`` (M, pairs) m are those that were kept; ``declared`` (M, pairs) says where contact is
        allowed to be ``contact_depth`` m deep.
        """
        bodies = tuple((one.name, other.name) for one, other in self._model.pairs)
        if not any(self._kept):
            rows = np.full((len(stamp_ns), 2, 3), np.nan)
            return WorstPair(stamp_ns, bodies, np.zeros(len(rows), dtype=np.int64), rows[:, 0, 0], rows)
        kept, instants = np.array(self._kept, dtype=np.int64), np.arange(len(self._kept))
        distance = np.take_along_axis(distances, kept, axis=1)
        contact = np.take_along_axis(declared, kept, axis=1)
        margin = distance + contact_depth * contact
        margin[contact & (margin >= 0.0)] = np.inf
        worst = margin.argmin(axis=1)
        counts = np.isfinite(margin[instants, worst])
        pair = np.where(counts, kept[instants, worst], 0)
        points = np.array(self._points)[instants, worst]
        points[~counts] = np.nan
        return WorstPair(stamp_ns, bodies, pair, np.where(counts, distance[instants, worst], np.nan), points)
