"""Signed distances between all bodies at one configuration, with the points that are nearest."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from sms_handover.clearance.allowed_pairs import counted_pairs
from sms_handover.clearance.bodies import DEPUTY_BODY, Body, bodies_of
from sms_handover.clearance.solids import read_solids
from sms_handover.frames import DEPUTY
from sms_handover.model.poses import se3_of
from sms_handover.model.shape_elements import read_contacts
from sms_handover.types import Array, Pose, read_only


@dataclass(frozen=True, eq=False)
class NearestPoints:
    """Where two bodies are nearest to each other, or deepest in each other.

    ``points_in_world`` (2, 3) m lie on the first and on the second body; ``normal_in_world`` (3,) is the unit
    vector from the first body to the second, along which they come apart.
    """

    points_in_world: Array
    normal_in_world: Array

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "points_in_world", read_only(self.points_in_world))
        object.__setattr__(self, "normal_in_world", read_only(self.normal_in_world))


class ClearanceModel:
    """The bodies of a robot and of the deputy, and the signed distance between every two that count.

    A distance is that of the nearest points; where two bodies enter each other it is minus the least
    translation that parts them (coal's GJK and EPA). It depends on the configuration alone, bit for bit. An
    instance owns work space, so it is not to be shared between threads.
    """

    def __init__(self, model: pin.Model, urdf: str, arms: Sequence[str], deputy_size: Array) -> None:
        """Read the shapes of a description and add the deputy as a box with these edges (3,) m.

        ``model`` is Pinocchio's reading of ``urdf``. Raises RobotDescriptionError if the shapes cannot
        be read.
        """
        self._model, self._data = model, model.createData()
        geometry = read_solids(model, urdf)
        robot_bodies = bodies_of(model, geometry, arms)
        stated = read_contacts(urdf)
        pairs = counted_pairs(model, geometry, stated)
        box = coal.Box(*(float(edge) for edge in deputy_size))
        universe = 0  # Pinocchio's number of the joint that never moves: the deputy is placed by hand
        deputy = pin.GeometryObject(DEPUTY_BODY.name, universe, pin.SE3.Identity(), box)
        links = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
        self._deputy = geometry.addGeometryObject(deputy)
        pairs += [(body, self._deputy) for body, link in enumerate(links) if not stated.allows(link, DEPUTY)]
        for pair in pairs:
            geometry.addCollisionPair(pin.CollisionPair(*pair))
        self.bodies: tuple[Body, ...] = (*robot_bodies, DEPUTY_BODY)
        self.pairs: tuple[tuple[Body, Body], ...] = tuple((self.bodies[a], self.bodies[b]) for a, b in pairs)
        carriers = [int(item.parentJoint) for item in geometry.geometryObjects]
        self.joints: tuple[tuple[int, int], ...] = tuple(
            (carriers[one], carriers[other]) for one, other in pairs
        )
        self._geometry, self._results = geometry, _results_without_memory(geometry)
        self._found = list(self._results.distanceResults)  # views: asking for them each time takes longest

    def distances(self, q: Array, deputy_in_world: Pose) -> Array:
        """Return the signed distance (pairs,) m of every pair at a configuration (7 + n,)."""
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._results, q)
        self._results.oMg[self._deputy] = se3_of(deputy_in_world)
        pin.computeDistances(self._geometry, self._results)
        return np.array([found.min_distance for found in self._found])

    def nearest_points(self, pair: int) -> NearestPoints:
        """Return where a pair is nearest, at the configuration of the last call of :meth:`distances`."""
        result = self._found[pair]
        points = np.array([result.getNearestPoint1(), result.getNearestPoint2()])
        return NearestPoints(points, np.array(result.normal))


def _results_without_memory(geometry: pin.GeometryModel) -> pin.GeometryData:
    """Return work space for distances in which no search begins where the one before has ended.

    Pinocchio lets them, which moves a distance by up to 2e-6 m with the configurations before it: a run that
    goes on from a snapshot would not be the same. Here they begin from the boxes about the bodies.
    """
    for item in geometry.geometryObjects:
        item.geometry.computeLocalAABB()
    results = pin.GeometryData(geometry)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of the switch that Pinocchio turns on
        for request in results.distanceRequests:
            request.enable_cached_gjk_guess = False
            request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
    return results
