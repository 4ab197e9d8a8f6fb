"""Deviation of one sequence of states from another, tick by tick."""

from dataclasses import dataclass

import numpy as np

from sms_handover.analysis.numbers import angle_between
from sms_handover.types import RobotState


@dataclass(frozen=True)
class StateDeviation:
    """Deviation of two states with the same stamp: joint and base angle in rad, base position in m."""

    stamp_ns: int
    joint: int
    joint_angle: float
    base_position: float
    base_angle: float
    same_bits: bool


def state_deviation(one: RobotState, other: RobotState) -> StateDeviation:
    """Return the deviation of two states; ``joint`` is the index of the joint that deviates most.

    ``same_bits`` compares the whole states, velocities and efforts included.
    """
    joints = np.abs(other.joint_position - one.joint_position)
    joint = int(np.argmax(joints))
    bases = one.base_in_world, other.base_in_world
    return StateDeviation(
        stamp_ns=other.stamp_ns,
        joint=joint,
        joint_angle=float(joints[joint]),
        base_position=float(np.linalg.norm(bases[1].position - bases[0].position)),
        base_angle=float(angle_between(*(base.quaternion_xyzw for base in bases))),
        same_bits=_bits(one) == _bits(other),
    )


class LargestDeviation:
    """The largest deviations of a sequence, where each occurred, and where the first bit differed."""

    def __init__(self) -> None:
        self.compared = 0
        self.first: StateDeviation | None = None
        self.joint: StateDeviation | None = None
        self.base_position: StateDeviation | None = None
        self.base_angle: StateDeviation | None = None

    def add_same(self) -> None:
        """Count a tick whose states are known to be identical."""
        self.compared += 1

    def add(self, deviation: StateDeviation) -> None:
        """Add the deviation of one tick."""
        self.compared += 1
        if deviation.same_bits:
            return
        self.first = self.first or deviation
        self.joint = max(self.joint or deviation, deviation, key=lambda each: each.joint_angle)
        self.base_position = max(
            self.base_position or deviation, deviation, key=lambda each: each.base_position
        )
        self.base_angle = max(self.base_angle or deviation, deviation, key=lambda each: each.base_angle)


def _bits(state: RobotState) -> bytes:
    """Return all numbers of a state as bytes."""
    return state.q.tobytes() + state.v.tobytes() + state.joint_effort.tobytes()
