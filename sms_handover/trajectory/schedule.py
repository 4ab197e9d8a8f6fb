"""Schedule of a task as values: targets of every arm over time, and grasps."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.known_payload import EMPTY_HANDS, Grip, grip_after
from sms_handover.types import Array, GraspCommand, Pose, freeze, read_only


@dataclass(frozen=True)
class Hold:
    """Hold the joint angles from the start of the phase."""


@dataclass(frozen=True, eq=False)
class JointTarget:
    """Move to joint angles (joints of the arm,) rad."""

    position: Array

    def __post_init__(self) -> None:
        freeze(self, "position")


@dataclass(frozen=True, eq=False)
class ToolTarget:
    """Move the tool to a pose in ``world``."""

    tool_in_world: Pose


@dataclass(frozen=True, eq=False)
class GraspFrameTarget:
    """Move the tool to a pose relative to a grasp frame of the deputy."""

    grasp_frame: str
    tool_in_grasp_frame: Pose


ArmTarget = Hold | JointTarget | ToolTarget | GraspFrameTarget


class MissAction(Enum):
    """What to do when a grasp of a phase does not succeed; the value is the word in the file."""

    CONTINUE = "continue"
    ABORT = "abort"
    RETRY = "retry"


@dataclass(frozen=True)
class OnMiss:
    """What to do when a grasp misses, and the most retries."""

    action: MissAction = MissAction.CONTINUE
    retries: int = 0


@dataclass(frozen=True, eq=False)
class Phase:
    """One phase: its time span, the target of every arm, and the commands at its start.

    ``motion_ns`` is how long a smooth time law takes to reach the targets; ``gains`` has, per
    control law, the gains that differ from the controller's own while the phase lasts.
    """

    name: str
    start_ns: int
    end_ns: int
    motion_ns: int
    targets: Mapping[str, ArmTarget]
    commands: tuple[GraspCommand, ...] = ()
    gains: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    on_miss: OnMiss = OnMiss()

    def __post_init__(self) -> None:
        object.__setattr__(self, "targets", MappingProxyType(dict(self.targets)))
        object.__setattr__(self, "gains", MappingProxyType(dict(self.gains)))


@dataclass(frozen=True, eq=False)
class Schedule:
    """A whole task: the initial state, and the phases in order.

    ``initial_joints`` has the joint angles per arm. ``text`` is the file as read, for the record.
    """

    initial_joints: Mapping[str, Array]
    base_in_world: Pose
    deputy: DeputyDescription
    phases: tuple[Phase, ...]
    text: str

    def __post_init__(self) -> None:
        joints = {arm: read_only(values) for arm, values in self.initial_joints.items()}
        object.__setattr__(self, "initial_joints", MappingProxyType(joints))

    @property
    def end_ns(self) -> int:
        """When the last phase ends, in ns of simulation time."""
        return self.phases[-1].end_ns

    @property
    def grasping_arms(self) -> tuple[frozenset[str], ...]:
        """Phase by phase, the arms that go to a grasp frame."""
        return tuple(
            frozenset(arm for arm, target in phase.targets.items() if isinstance(target, GraspFrameTarget))
            for phase in self.phases
        )

    @property
    def grips(self) -> tuple[Grip, ...]:
        """Phase by phase, who holds the deputy if every command succeeds."""
        found, grip = [], EMPTY_HANDS
        for phase in self.phases:
            for command in phase.commands:
                grip = grip_after(command)
            found.append(grip)
        return tuple(found)

    def phase_index(self, stamp_ns: int) -> int:
        """Return the index of the phase at a time; after the end it is the last one."""
        started = [index for index, phase in enumerate(self.phases) if phase.start_ns <= stamp_ns]
        return started[-1]
