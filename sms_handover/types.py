"""Types of the values that core modules exchange; every array in them is read-only.

All are in SI units and radians. Joint arrays have one entry per joint, in the order of
``RobotModel.joint_names``. Poses keep position and quaternion as in a message, so that values
sent over DDS stay equal bit for bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from math import nan
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from sms_handover.units import MM_PER_M, ns_to_seconds

Array = npt.NDArray[np.float64]

BASE_NQ = 7  # position and quaternion of the base at the head of a configuration
BASE_NV = 6  # its twist, linear then angular, in base_link axes, at the head of a velocity

_FLOAT64 = np.dtype(np.float64)


def read_only(values: npt.ArrayLike) -> Array:
    """Return ``values`` as a read-only float64 array, copied unless nobody can write to its memory.

    That is the memory of the array itself and of the array it is a view of.
    """
    if type(values) is np.ndarray and values.dtype == _FLOAT64 and not values.flags.writeable:
        base = values.base
        if base is None or type(base) is bytes or (isinstance(base, np.ndarray) and not base.flags.writeable):
            return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def frozen(array: Array) -> Array:
    """Return an array that nobody else holds, made read-only without a copy."""
    array.setflags(write=False)
    return array


def freeze(value: object, *names: str) -> None:
    """Make fields of a frozen dataclass read-only arrays."""
    for name in names:
        object.__setattr__(value, name, read_only(getattr(value, name)))


@dataclass(frozen=True, eq=False)
class Pose:
    """The pose ``a_in_b`` of one frame in another: position (3,) m and quaternion (4,) x y z w."""

    position: Array
    quaternion_xyzw: Array

    def __post_init__(self) -> None:
        freeze(self, "position", "quaternion_xyzw")


@dataclass(frozen=True, eq=False)
class Twist:
    """Linear part (3,) m/s and angular part (3,) rad/s; the variable names the frames."""

    linear: Array
    angular: Array

    def __post_init__(self) -> None:
        freeze(self, "linear", "angular")

    @property
    def row(self) -> Array:
        """Both parts as one row (6,)."""
        return np.concatenate([self.linear, self.angular])


@dataclass(frozen=True, eq=False)
class RobotState:
    """The state of the robot at one tick.

    ``q`` (7 + n,) is position and quaternion x y z w of ``base_link`` in ``world``, then the joint
    angles; ``v`` (6 + n,) is the twist of ``base_link`` in its own axes, then the joint rates.
    ``joint_effort`` (n,) N m is what the plant applied over the tick that ended at ``stamp_ns``.
    """

    stamp_ns: int
    q: Array
    v: Array
    joint_effort: Array

    def __post_init__(self) -> None:
        freeze(self, "q", "v", "joint_effort")

    @cached_property
    def base_in_world(self) -> Pose:
        """The pose of ``base_link``."""
        return Pose(self.q[:3], self.q[3:BASE_NQ])

    @cached_property
    def twist_base_in_base(self) -> Twist:
        """The twist of ``base_link`` in its own axes."""
        return Twist(self.v[:3], self.v[3:BASE_NV])

    @property
    def joint_position(self) -> Array:
        """The joint angles (n,) in rad."""
        return self.q[BASE_NQ:]

    @property
    def joint_velocity(self) -> Array:
        """The joint rates (n,) in rad/s."""
        return self.v[BASE_NV:]


@dataclass(frozen=True, eq=False)
class JointReference:
    """Desired joint position (n,) rad and velocity (n,) rad/s, valid from ``stamp_ns`` on."""

    stamp_ns: int
    position: Array
    velocity: Array

    def __post_init__(self) -> None:
        freeze(self, "position", "velocity")


@dataclass(frozen=True, eq=False)
class JointCommand:
    """Joint efforts (n,) N m for the state of the same stamp."""

    stamp_ns: int
    effort: Array

    def __post_init__(self) -> None:
        freeze(self, "effort")


@dataclass(frozen=True)
class BaseWrench:
    """Force (3,) N at the origin of base_link and torque (3,) N m about it, over the tick of a stamp.

    Both are in the axes of ``frame``, which is ``world`` or ``base_link``.
    """

    stamp_ns: int
    frame: str
    force: tuple[float, ...]
    torque: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TickRows:
    """Ticks as arrays, a row each: stamps (k,) ns, q (k, 7 + n), v (k, 6 + n), and efforts (k, n) N m.

    ``joint_effort`` acted up to the state, ``effort`` answers it. With sensors ``measured`` (k, 13 + 2 n) has
    q and v as they are known.
    """

    stamp_ns: npt.NDArray[np.int64]
    q: Array
    v: Array
    joint_effort: Array
    effort: Array
    measured: Array | None = None

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True, eq=False)
class PeriodRows:
    """Reference periods as arrays, a row each: what every one began with.

    Stamps (k,) ns; references (k, n) rad and rad/s; poses (k, 7) of targets and tools by arm, and of the
    deputy, whose twist (k, 6) is in its own axes; momenta (k, 3); kinetic energy, and since the start work of
    the joints, work of wrenches from outside and what became heat (k,) J, and the impulses of those wrenches
    (k, 3); the status of inverse kinematics, None where it was not asked.
    """

    stamp_ns: npt.NDArray[np.int64]
    reference_position: Array
    reference_velocity: Array
    target_pose: Mapping[str, Array]
    tool_pose: Mapping[str, Array]
    deputy_pose: Array
    deputy_twist: Array
    linear_momentum: Array
    angular_momentum: Array
    kinetic_energy: Array
    work: Array
    external_work: Array
    lost: Array
    linear_impulse: Array
    angular_impulse: Array
    ik_status: tuple["IkStatus | None", ...]


class IkStatus(Enum):
    """How an inverse-kinematics solve ended; the value is what a user reads."""

    CONVERGED = "converged"
    STALLED = "stalled at the nearest pose found: the target is out of reach from this seed"
    ITERATION_LIMIT = "stopped at the iteration limit"


@dataclass(frozen=True, eq=False)
class IkRequest:
    """Targets of the tools in ``world``, per arm name, solved with the base locked where it is.

    An arm without a target keeps the joints of the seed.
    """

    base_in_world: Pose
    seed: Array
    tool_in_world: Mapping[str, Pose]

    def __post_init__(self) -> None:
        freeze(self, "seed")
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))


@dataclass(frozen=True, eq=False)
class IkResult:
    """The configuration found and its quality, whatever the status.

    ``position_error`` m and ``orientation_error`` rad are the largest over the arms asked for;
    ``limit_margin`` rad is the smallest distance of any joint of the robot to its nearer limit;
    ``manipulability`` has sqrt(det(J J^T)) per arm of the robot [Yoshikawa1985];
    ``seed_distance`` rad is the largest joint step away from the seed.
    """

    joint_position: Array
    status: IkStatus
    iterations: int
    position_error: float
    orientation_error: float
    limit_margin: float
    manipulability: Array
    seed_distance: float

    def __post_init__(self) -> None:
        freeze(self, "joint_position", "manipulability")


class GraspAction(Enum):
    """The kinds of grasp command."""

    GRASP = "grasp"
    RELEASE = "release"
    TRANSFER = "transfer"


@dataclass(frozen=True)
class GraspCommand:
    """A command to ``arm``; a grasp names the grasp frame of the deputy.

    A transfer is a release by ``from_arm`` and a grasp by ``arm`` at the same instant, so no
    closed kinematic chain forms; if the grasp misses, ``from_arm`` keeps holding.
    """

    action: GraspAction
    arm: str
    grasp_frame: str = ""
    from_arm: str = ""


class GraspStatus(Enum):
    """The outcome of a grasp command."""

    SUCCEEDED = "succeeded"
    MISSED = "missed"
    REJECTED = "rejected"


@dataclass(frozen=True)
class GraspEvent:
    """The outcome of a grasp command with the errors of the tool against the grasp frame, and its impulse.

    ``position_error`` m, ``angle_error`` rad, ``relative_speed`` m/s, ``relative_rate`` rad/s; NaN where they
    do not apply. ``relative_twist`` (6 numbers) is that of the deputy relative to the hand before it closed,
    ``impulse`` N s and N m s what the hand gave to the deputy, both about the origin of the deputy in
    ``world`` axes. ``energy_lost`` J has become heat in the grip.
    """

    stamp_ns: int
    command: GraspCommand
    status: GraspStatus
    position_error: float
    angle_error: float
    relative_speed: float
    detail: str
    relative_rate: float = nan
    relative_twist: tuple[float, ...] = (nan,) * 6
    impulse: tuple[float, ...] = (0.0,) * 6
    energy_lost: float = 0.0


@dataclass(frozen=True)
class Collision:
    """Two bodies that are nearer to each other than ``allowed`` at ``stamp_ns``: signed distances in m.

    ``group`` is what reports count the two to; ``allowed`` is 0, or minus the depth of a declared contact.
    """

    stamp_ns: int
    group: str
    bodies: tuple[str, str]
    distance: float
    allowed: float

    def __str__(self) -> str:
        """Return which two bodies overlap, by how much and when."""
        first, second = self.bodies
        depth_mm, time_s = -self.distance * MM_PER_M, ns_to_seconds(self.stamp_ns)
        return f"{first} and {second} overlap by {depth_mm:.2f} mm at {time_s:.2f} s"


class PhaseState(Enum):
    """Whether a phase is active, or has failed and the joints are held."""

    ACTIVE = "active"
    FAILED = "failed"


@dataclass(frozen=True)
class TaskPhase:
    """The current phase of the schedule and the grasp commands due at ``stamp_ns``.

    ``attempt`` counts the repetitions of the phase from 1. ``end_ns`` is the expected end of the task,
    0 if unknown.
    """

    stamp_ns: int
    index: int
    name: str
    commands: tuple[GraspCommand, ...] = ()
    state: PhaseState = PhaseState.ACTIVE
    attempt: int = 1
    end_ns: int = field(default=0, repr=False)  # not in recordings of older versions

    @property
    def failed(self) -> bool:
        """Whether the phase has failed."""
        return self.state is PhaseState.FAILED

    @property
    def entry(self) -> tuple[int, int, PhaseState]:
        """What changes when a phase begins, is repeated or fails."""
        return self.index, self.attempt, self.state


@dataclass(frozen=True, eq=False)
class DeputyState:
    """Pose and twist of the deputy; ``holder`` is an arm name, or '' while it floats."""

    deputy_in_world: Pose
    twist_deputy_in_world: Twist
    holder: str
