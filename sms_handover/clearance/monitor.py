"""Clearance monitor: how near bodies are to each other during a run, each reference period."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.clearance.contacts import Group, contacts_of, fixed_groups
from sms_handover.clearance.distances import ClearanceModel, NearestPoints
from sms_handover.types import Array, Collision, Pose


@dataclass(frozen=True, eq=False)
class GroupDistance:
    """The least signed distance in m within a group of bodies at one instant, and where it is.

    ``allowed`` is 0, or minus the depth of a declared contact; what is less is a collision.
    """

    group: str
    bodies: tuple[str, str]
    distance: float
    allowed: float
    nearest: NearestPoints

    @property
    def margin(self) -> float:
        """How much farther apart than allowed the bodies are, m; negative in a collision."""
        return self.distance - self.allowed


@dataclass(frozen=True, eq=False)
class PeriodClearance:
    """The clearance of every group of bodies at the instant ``stamp_ns``, the worst one first."""

    stamp_ns: int
    groups: tuple[GroupDistance, ...]

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The groups whose bodies are nearer than is allowed."""
        return tuple(
            Collision(self.stamp_ns, item.group, item.bodies, item.distance, item.allowed)
            for item in self.groups
            if item.margin < 0.0
        )


@dataclass(frozen=True)
class MonitorState:
    """Per contact that can be declared, in the order of the pairs: whether it is, and whether it held."""

    declared: tuple[bool, ...]
    has_held: tuple[bool, ...]


class ClearanceMonitor:
    """Measures the clearance of one run as it goes on."""

    def __init__(
        self, model: ClearanceModel, grasping: Sequence[frozenset[str]], contact_depth: float
    ) -> None:
        """Watch the pairs of a model; ``grasping`` has, by phase, the arms that go to a grasp frame.

        Gripper and deputy may enter each other by ``contact_depth`` m where their contact is declared.
        """
        self._model, self._grasping, self._depth = model, grasping, contact_depth
        self._fixed = {group: np.array(pairs) for group, pairs in fixed_groups(model.pairs).items()}
        self.reset()

    def reset(self) -> None:
        """Return to the start of the run."""
        self._contacts = contacts_of(self._model.pairs)

    def snapshot(self) -> MonitorState:
        """Return the state to :meth:`restore`."""
        contacts = self._contacts.values()
        return MonitorState(tuple(c.declared for c in contacts), tuple(c.has_held for c in contacts))

    def restore(self, state: MonitorState) -> None:
        """Go back to a former state."""
        states = zip(self._contacts.values(), state.declared, state.has_held, strict=True)
        for contact, declared, has_held in states:
            contact.declared, contact.has_held = declared, has_held

    def measure(
        self, stamp_ns: int, q: Array, deputy_in_world: Pose, phase: int, holder: str
    ) -> PeriodClearance:
        """Return the clearance at a configuration (7 + n,) in the phase of an index of the schedule.

        ``holder`` is the arm that holds the deputy after the grasp commands of this instant, '' if none.
        """
        distances = self._model.distances(q, deputy_in_world)
        least = {group: int(pairs[distances[pairs].argmin()]) for group, pairs in self._fixed.items()}
        aims = self._grasping[phase] if phase < len(self._grasping) else frozenset()
        for pair, contact in self._contacts.items():
            arm, distance = contact.arm, float(distances[pair])
            group = contact.advance(distance, aims=arm in aims, holds=arm == holder)
            if group not in least or distance < distances[least[group]]:
                least[group] = pair
        found = [self._distance(group, pair, float(distances[pair])) for group, pair in least.items()]
        return PeriodClearance(stamp_ns, tuple(sorted(found, key=lambda item: item.margin)))

    def _distance(self, group: Group, pair: int, distance: float) -> GroupDistance:
        """Return the distance of a group, which is that of a pair."""
        one, other = self._model.pairs[pair]
        nearest = self._model.nearest_points(pair)
        allowed = group.allowed(self._depth)
        return GroupDistance(group.label, (one.name, other.name), distance, allowed, nearest)
