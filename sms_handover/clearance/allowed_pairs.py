"""Which pairs of bodies may touch by design, and are therefore not looked at."""

from itertools import combinations

import numpy as np
import pinocchio as pin

from sms_handover.model.shapes import ContactPairs
from sms_handover.types import BASE_NQ

_SAMPLES = 200  # [-] random configurations; a pair that touches in all of them touches by design
_SEED = 16


def counted_pairs(
    model: pin.Model, geometry: pin.GeometryModel, stated: ContactPairs
) -> list[tuple[int, int]]:
    """Return the pairs of geometry objects of a robot between which clearance counts.

    Left out are bodies that no joint moves against each other, neighbours (a link and the next one along
    the chain), and pairs that touch at every one of 200 configurations drawn within the joint limits
    from a fixed seed. What seldom or never touches stays: samples cannot prove that it never will. What is
    ``stated`` of a pair of links holds instead, for all their solids.
    """
    pairs = [
        (first, second)
        for first, second in combinations(range(geometry.ngeoms), 2)
        if not joined(model, geometry, first, second)
    ]
    touching = _always_touching(model, geometry, pairs)
    derived = set(pairs) - touching
    names = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    return [
        (first, second)
        for first, second in combinations(range(geometry.ngeoms), 2)
        if stated.counts(names[first], names[second])
        or ((first, second) in derived and not stated.allows(names[first], names[second]))
    ]


def joined(model: pin.Model, geometry: pin.GeometryModel, first: int, second: int) -> bool:
    """Whether two bodies are fixed to each other, or are neighbours along a chain of links."""
    one, other = geometry.geometryObjects[first], geometry.geometryObjects[second]
    if one.parentJoint == other.parentJoint:
        return True
    solid = {item.parentFrame for item in geometry.geometryObjects}
    carriers = _carrier(model, one.parentFrame, solid), _carrier(model, other.parentFrame, solid)
    return bool(other.parentFrame == carriers[0] or one.parentFrame == carriers[1])


def _carrier(model: pin.Model, link: int, solid: set[int]) -> int:
    """Return the nearest link with a shape that carries a link, 0 (Pinocchio's universe) if there is none."""
    above = model.frames[link].parentFrame
    while above != 0 and above not in solid:
        above = model.frames[above].parentFrame
    return int(above)


def _always_touching(
    model: pin.Model, geometry: pin.GeometryModel, pairs: list[tuple[int, int]]
) -> set[tuple[int, int]]:
    """Return the pairs that touch or enter each other whatever the joint angles."""
    sampled, data = geometry.copy(), model.createData()
    random = np.random.default_rng(_SEED)
    lower = np.maximum(model.lowerPositionLimit[BASE_NQ:], -np.pi)
    upper = np.minimum(model.upperPositionLimit[BASE_NQ:], np.pi)
    q, touching = pin.neutral(model), pairs
    for _ in range(_SAMPLES):
        if not touching:
            break
        sampled.removeAllCollisionPairs()
        for pair in touching:
            sampled.addCollisionPair(pin.CollisionPair(*pair))
        distances = pin.GeometryData(sampled)
        q[BASE_NQ:] = random.uniform(lower, upper)
        pin.updateGeometryPlacements(model, data, sampled, distances, q)
        pin.computeDistances(sampled, distances)
        results = zip(touching, distances.distanceResults, strict=True)
        touching = [pair for pair, result in results if result.min_distance <= 0.0]
    return set(touching)
