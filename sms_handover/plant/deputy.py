"""The deputy: a CubeSat that floats or is held by one arm, and the tolerances of a grasp."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.types import Array, DeputyState, Pose, Twist, freeze, read_only


@dataclass(frozen=True)
class GraspTolerance:
    """The largest errors at which a grasp holds: m, rad, m/s, rad/s.

    Older versions did not judge the rate.
    """

    position: float
    angle: float
    speed: float
    rate: float = inf


@dataclass(frozen=True)
class GraspErrors:
    """Errors of the tool with respect to the grasp frame: m, rad, m/s, rad/s."""

    position: float
    angle: float
    speed: float
    rate: float

    def within(self, tolerance: GraspTolerance) -> bool:
        """Whether every error is within its tolerance."""
        return (
            self.position <= tolerance.position
            and self.angle <= tolerance.angle
            and self.speed <= tolerance.speed
            and self.rate <= tolerance.rate
        )


@dataclass(frozen=True, eq=False)
class DeputyMotion:
    """Free motion since the deputy was last placed, and how it is held.

    Matrices are homogeneous (4, 4): ``start`` is the pose then in ``world``, ``in_tool`` that in the tool of
    ``holder``. A deputy with mass floats at ``q`` (7,), position and quaternion, with the twist ``v`` (6,) in
    its own axes; both are empty without mass.
    """

    start: Array
    twist: Twist
    drifted_s: float
    holder: str
    in_tool: Array
    q: Array = field(default_factory=lambda: read_only([]))
    v: Array = field(default_factory=lambda: read_only([]))

    def __post_init__(self) -> None:
        freeze(self, "start", "in_tool", "q", "v")


class MasslessDeputy:
    """A rigid deputy whose mass is neglected: held, it moves with the tool; free, it drifts.

    Free motion keeps the twist at release: constant velocity of the origin and constant angular velocity. A
    grasp freezes the relative pose of tool and deputy, so its position error persists and nothing jumps.
    """

    def __init__(
        self, deputy_in_world: Pose, grasp_frames: Mapping[str, Pose], twist_in_world: Twist | None = None
    ) -> None:
        """Place it at time zero, at rest unless it is given a twist of its origin in ``world`` axes."""
        self._grasp_frames = {name: se3_of(pose) for name, pose in grasp_frames.items()}
        self._carried: Pose | None = None  # the pose as it was given
        self._place(se3_of(deputy_in_world), twist_in_world or Twist(np.zeros(3), np.zeros(3)))
        self._holder = ""
        self._deputy_in_tool = pin.SE3.Identity()

    @property
    def state(self) -> DeputyState:
        """Return pose and twist in ``world`` axes, and who holds it."""
        return DeputyState(self._carried or pose_of(self._pose()), self._twist, self._holder)

    @property
    def in_tool(self) -> pin.SE3:
        """The pose in the tool that holds it."""
        return self._deputy_in_tool

    @property
    def rests(self) -> bool:
        """Whether it floats where it is."""
        return not (self._holder or np.any(self._twist.linear) or np.any(self._twist.angular))

    @property
    def motion(self) -> DeputyMotion:
        """Everything that its later motion depends on."""
        start, in_tool = self._start.homogeneous, self._deputy_in_tool.homogeneous
        return DeputyMotion(start, self._twist, self._drifted_s, self._holder, in_tool)

    def restore(self, motion: DeputyMotion) -> None:
        """Go back to a former :attr:`motion`."""
        self._place(pin.SE3(motion.start), motion.twist)
        self._drifted_s, self._holder = motion.drifted_s, motion.holder
        self._deputy_in_tool = pin.SE3(motion.in_tool)

    @property
    def holder(self) -> str:
        """Return the name of the arm that holds the deputy, '' while it floats."""
        return self._holder

    def errors_of(self, grasp_frame: str, tool_in_world: Pose, tool_twist_in_world: Twist) -> GraspErrors:
        """Return the errors of a tool with respect to a grasp frame; the speed is between the two origins."""
        deputy = self._pose()
        frame = deputy * self._grasp_frames[grasp_frame]
        position, angle = pose_distance(pose_of(frame), tool_in_world)
        lever = frame.translation - deputy.translation
        frame_velocity = self._twist.linear + _cross(self._twist.angular, lever)
        speed = float(np.linalg.norm(tool_twist_in_world.linear - frame_velocity))
        rate = float(np.linalg.norm(tool_twist_in_world.angular - self._twist.angular))
        return GraspErrors(position, angle, speed, rate)

    def twist_relative_to(self, tool_in_world: Pose, tool_twist_in_world: Twist) -> tuple[float, ...]:
        """Return its twist (6 numbers) relative to a hand, about its origin in ``world`` axes."""
        hand, lever = tool_twist_in_world, self._pose().translation - tool_in_world.position
        linear = self._twist.linear - (hand.linear + _cross(hand.angular, lever))
        angular = self._twist.angular - hand.angular
        return (*linear.tolist(), *angular.tolist())

    def attach(self, arm: str, tool_in_world: Pose) -> None:
        """Attach the deputy to a tool at their present relative pose."""
        self._holder = arm
        self._deputy_in_tool = se3_of(tool_in_world).actInv(self._pose())

    def detach(self) -> None:
        """Release the deputy: it drifts with its present twist."""
        self._holder, self._carried = "", None

    def follow(self, tool_in_world: Pose, tool_twist_in_world: Twist) -> None:
        """Move with the tool that holds it."""
        tool = se3_of(tool_in_world)
        pose = tool * self._deputy_in_tool
        lever = pose.translation - tool.translation
        linear = tool_twist_in_world.linear + _cross(tool_twist_in_world.angular, lever)
        self._place(pose, Twist(linear, tool_twist_in_world.angular))

    def carry(self, deputy_in_world: Pose, twist_deputy_in_world: Twist) -> None:
        """Move to where the tool that holds it has carried it."""
        self._place(se3_of(deputy_in_world), twist_deputy_in_world)
        self._carried = deputy_in_world

    def drift(self, duration: float) -> None:
        """Move freely over ``duration`` s."""
        self._drifted_s += duration

    def _place(self, pose: pin.SE3, twist: Twist) -> None:
        """Begin to drift from a pose with a twist."""
        self._start, self._twist, self._drifted_s = pose, twist, 0.0
        self._carried = None

    def _pose(self) -> pin.SE3:
        """Return the present pose: p0 + v t, exp(omega t) R0 since it was last placed."""
        if not self._drifted_s:
            return self._start
        turn = pin.exp3(self._twist.angular * self._drifted_s)
        way = self._twist.linear * self._drifted_s
        return pin.SE3(turn @ self._start.rotation, self._start.translation + way)


def _cross(a: Array, b: Array) -> Array:
    """Return a x b; ``np.cross`` takes twenty times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
