"""Distance rows: the nearest pairs of bodies at each instant of a prediction, linearised."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.control.distance_gradients import DistanceGradients
from sms_handover.control.mpc.placement import Placement
from sms_handover.control.mpc.prediction import Derivatives
from sms_handover.control.protocol import Distances
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array


@dataclass(frozen=True, eq=False)
class DistanceRows:
    """Signed distances (K, r) m of the r nearest pairs at K instants, by name, and their derivatives.

    ``at_start`` (K, r) m are the distances of the same pairs where the prediction begins, ``least`` (K, r) m
    what they are not to be below.
    """

    distance: Array
    at_start: Array
    least: Array
    names: tuple[tuple[str, ...], ...]
    by: Derivatives


class DistanceModel:
    """Finds the nearest pairs of a robot and the deputy."""

    def __init__(self, robot: RobotModel, distances: Distances, most: int, least: float) -> None:
        """Find up to ``most`` pairs at each instant, of which none is to be nearer than ``least`` m."""
        self._robot, self._gradients = robot, DistanceGradients(robot, distances, least)
        self._most = min(most, len(distances.pairs))

    def at(self, placed: Sequence[Placement], targets: Sequence[PreviewedTargets]) -> DistanceRows:
        """Return the rows at all placements but the first, which only tells what distances are at the start.

        A gripper that may touch the deputy is only not to enter it, and the hand that holds it has no row.
        """
        gradients, start, placed = self._gradients, placed[0], placed[1:]
        beginning = gradients.at(start.q, targets[0])
        count, most, n = len(placed), self._most, self._robot.n_joints
        distance, at_start, least = (np.zeros((count, most)) for _ in range(3))
        names = list[tuple[str, ...]]()
        by_q, by_phi = np.zeros((count, most, n)), np.zeros((count, most, 3))
        for k, (place, target) in enumerate(zip(placed, targets, strict=True)):
            found, limits = gradients.at(place.q, target), gradients.least(target)
            nearest = np.argsort(found - limits, kind="stable")[:most]
            for row, index in enumerate(nearest.tolist()):
                distance[k, row], at_start[k, row] = found[index], beginning[index]
                least[k, row] = limits[index]
                by_q[k, row], by_phi[k, row] = place.reduced(gradients.gradient(index, target))
            names.append(tuple(" - ".join(gradients.pairs[index].names) for index in nearest.tolist()))
        return DistanceRows(
            distance, at_start, least, tuple(names), Derivatives(by_q, np.zeros_like(by_q), by_phi)
        )
