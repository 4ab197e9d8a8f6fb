"""How far one course of states is from another, tick by tick."""

from dataclasses import dataclass

import numpy as np

from sms_handover.types import Pose, RobotState


@dataclass(frozen=True)
class StateDeviation:
    """How far two states of one stamp are apart: joint angle and base angle in rad, base position in m."""

    stamp_ns: int
    joint: int
    joint_angle: float
    base_position: float
    base_angle: float
    same_bits: bool


def state_deviation(one: RobotState, other: RobotState) -> StateDeviation:
    """Return how far two states are apart; ``joint`` is the place of the joint that is farthest.

    The base angle is that of the single turn between the two orientations, 2 atan2(|v|, |w|) with the
    vector and scalar parts of conj(q) q'. Whether every bit is the same is told of the whole states,
    with velocities and efforts.
    """
    joints = np.abs(other.joint_position - one.joint_position)
    joint = int(np.argmax(joints))
    bases = one.base_in_world, other.base_in_world
    same = _bits(one) == _bits(other)
    return StateDeviation(
        stamp_ns=other.stamp_ns,
        joint=joint,
        joint_angle=float(joints[joint]),
        base_position=float(np.linalg.norm(bases[1].position - bases[0].position)),
        base_angle=0.0 if same else _angle_between(*bases),
        same_bits=same,
    )


class LargestDeviation:
    """The largest deviations of a course, where each was, and where the first bit differed."""

    def __init__(self) -> None:
        self.compared = 0
        self.first: StateDeviation | None = None
        self.joint: StateDeviation | None = None
        self.base_position: StateDeviation | None = None
        self.base_angle: StateDeviation | None = None

    def add_same(self) -> None:
        """Count a tick whose states are known to be the same bit for bit."""
        self.compared += 1

    def add(self, deviation: StateDeviation) -> None:
        """Take the deviation of one tick."""
        self.compared += 1
        if deviation.same_bits:
            return
        self.first = self.first or deviation
        if self.joint is None or deviation.joint_angle > self.joint.joint_angle:
            self.joint = deviation
        if self.base_position is None or deviation.base_position > self.base_position.base_position:
            self.base_position = deviation
        if self.base_angle is None or deviation.base_angle > self.base_angle.base_angle:
            self.base_angle = deviation


def _bits(state: RobotState) -> bytes:
    """Return all numbers of a state as bytes."""
    return state.q.tobytes() + state.v.tobytes() + state.joint_effort.tobytes()


def _angle_between(one: Pose, other: Pose) -> float:
    """Return the angle in rad of the turn from one orientation to another."""
    x, y, z, w = one.quaternion_xyzw
    conjugate = np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]])
    turn = conjugate @ other.quaternion_xyzw
    return float(2.0 * np.arctan2(np.linalg.norm(turn[:3]), abs(turn[3])))
