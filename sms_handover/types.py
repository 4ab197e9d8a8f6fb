"""The values that cross the boundaries between core modules; every array in them is read-only.

All are in SI units and radians. Joint arrays have one entry per joint, in the order of
``RobotModel.joint_names``. Poses keep position and quaternion as they are in a message, so a
value that went over DDS and one that did not are equal bit for bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

BASE_NQ = 7  # position and quaternion of the base at the head of a configuration
BASE_NV = 6  # its twist, linear then angular, in base_link axes, at the head of a velocity

_FLOAT64 = np.dtype(np.float64)


def read_only(values: npt.ArrayLike) -> Array:
    """Return ``values`` as a float64 array that cannot be written to, copied unless it is one already.

    It is one if nobody can write to its memory, neither through it nor through the array it is a view of.
    """
    if type(values) is np.ndarray and values.dtype == _FLOAT64 and not values.flags.writeable:
        base = values.base
        if base is None or type(base) is bytes or (isinstance(base, np.ndarray) and not base.flags.writeable):
            return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def frozen(array: Array) -> Array:
    """Make an array that nobody else holds read-only, so that it can be passed on without a copy."""
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Pose:
    """The pose ``a_in_b`` of one frame in another: position (3,) m and quaternion (4,) x y z w."""

    position: Array
    quaternion_xyzw: Array

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "position", read_only(self.position))
        object.__setattr__(self, "quaternion_xyzw", read_only(self.quaternion_xyzw))


@dataclass(frozen=True, eq=False)
class Twist:
    """Linear part (3,) m/s and angular part (3,) rad/s; the variable names the frames."""

    linear: Array
    angular: Array

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "linear", read_only(self.linear))
        object.__setattr__(self, "angular", read_only(self.angular))


@dataclass(frozen=True, eq=False)
class RobotState:
    """The whole state of the robot at one tick.

    ``q`` (7 + n,) is position and quaternion x y z w of ``base_link`` in ``world``, then the joint
    angles; ``v`` (6 + n,) is the twist of ``base_link`` in its own axes, then the joint rates.
    ``joint_effort`` (n,) N m is what the plant applied over the tick that ended at ``stamp_ns``.
    """

    stamp_ns: int
    q: Array
    v: Array
    joint_effort: Array

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "q", read_only(self.q))
        object.__setattr__(self, "v", read_only(self.v))
        object.__setattr__(self, "joint_effort", read_only(self.joint_effort))

    @classmethod
    def of(
        cls,
        stamp_ns: int,
        base_in_world: Pose,
        twist_base_in_base: Twist,
        joint_position: Array,
        joint_velocity: Array,
        joint_effort: Array,
    ) -> "RobotState":
        """Return the state that is given part by part."""
        q = np.concatenate([base_in_world.position, base_in_world.quaternion_xyzw, joint_position])
        v = np.concatenate([twist_base_in_base.linear, twist_base_in_base.angular, joint_velocity])
        return cls(stamp_ns, q, v, joint_effort)

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
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "position", read_only(self.position))
        object.__setattr__(self, "velocity", read_only(self.velocity))


@dataclass(frozen=True, eq=False)
class JointCommand:
    """Joint efforts (n,) N m that answer the state of the same stamp."""

    stamp_ns: int
    effort: Array

    def __post_init__(self) -> None:
        """Copy the array and make it read-only."""
        object.__setattr__(self, "effort", read_only(self.effort))


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
        """Copy seed and targets and make them read-only."""
        object.__setattr__(self, "seed", read_only(self.seed))
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))


@dataclass(frozen=True, eq=False)
class IkResult:
    """The configuration found and how good it is, whatever the status.

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
        """Copy the arrays and make them read-only."""
        object.__setattr__(self, "joint_position", read_only(self.joint_position))
        object.__setattr__(self, "manipulability", read_only(self.manipulability))


class GraspAction(Enum):
    """What a grasp command asks of the plant."""

    GRASP = "grasp"
    RELEASE = "release"
    TRANSFER = "transfer"


@dataclass(frozen=True)
class GraspCommand:
    """One act on the deputy: ``arm`` acts; a grasp names the deputy's grasp frame it closes on.

    A transfer is a release by ``from_arm`` and a grasp by ``arm`` in the same instant, so no
    closed kinematic chain forms; if the grasp misses, ``from_arm`` keeps its hold.
    """

    action: GraspAction
    arm: str
    grasp_frame: str = ""
    from_arm: str = ""


class GraspStatus(Enum):
    """How the plant answered a grasp command."""

    SUCCEEDED = "succeeded"
    MISSED = "missed"
    REJECTED = "rejected"


@dataclass(frozen=True)
class GraspEvent:
    """What happened on a grasp command: errors of the tool against the grasp frame at that instant.

    ``position_error`` m, ``angle_error`` rad, ``relative_speed`` m/s; NaN where they do not apply.
    """

    stamp_ns: int
    command: GraspCommand
    status: GraspStatus
    position_error: float
    angle_error: float
    relative_speed: float
    detail: str


class PhaseState(Enum):
    """Whether a phase is carried out, or given up with the joints held where they were."""

    ACTIVE = "active"
    FAILED = "failed"


@dataclass(frozen=True)
class TaskPhase:
    """The phase of the schedule in force at ``stamp_ns`` and the grasp commands due at that instant.

    ``attempt`` is 1 the first time, and one more whenever the phase is done again. ``end_ns`` is when
    the task ends if nothing else happens; 0 where that is not told.
    """

    stamp_ns: int
    index: int
    name: str
    commands: tuple[GraspCommand, ...] = ()
    state: PhaseState = PhaseState.ACTIVE
    attempt: int = 1
    end_ns: int = field(default=0, repr=False)  # recordings of older versions do not tell it

    @property
    def failed(self) -> bool:
        """Whether the phase has been given up."""
        return self.state is PhaseState.FAILED

    @property
    def entry(self) -> tuple[int, int, PhaseState]:
        """Return what differs from the period before where a phase begins, begins again or is given up."""
        return self.index, self.attempt, self.state


@dataclass(frozen=True, eq=False)
class DeputyState:
    """Where the deputy is and who holds it: ``holder`` is an arm name, or '' while it floats."""

    deputy_in_world: Pose
    twist_deputy_in_world: Twist
    holder: str
