"""Previewed targets: what arms and deputy are expected to do, as a law that plans is told."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sms_handover.types import Array, Pose, TaskPhase, Twist, freeze


@dataclass(frozen=True, eq=False)
class PreviewedTargets:
    """What the arms are expected to do at one instant to come, as far as the schedule tells.

    ``tool_in_world`` has the target pose of every tool that leads its arm, ``tool_twist_in_world`` its twist;
    ``joint_position`` (n,) rad and ``joint_velocity`` (n,) rad/s the desired motion of all other arms.
    ``deputy`` is where the deputy is expected: in the tool of ``holder``, or in ``world`` while nobody holds
    it; ``touching`` has the arms whose gripper may touch it.
    """

    tool_in_world: Mapping[str, Pose]
    tool_twist_in_world: Mapping[str, Twist]
    joint_position: Array
    joint_velocity: Array
    holder: str
    deputy: Pose
    touching: frozenset[str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))
        object.__setattr__(self, "tool_twist_in_world", MappingProxyType(dict(self.tool_twist_in_world)))
        freeze(self, "joint_position", "joint_velocity")


@dataclass(frozen=True, eq=False)
class PreviewState:
    """Everything that a preview depends on: the phase as it began, the deputy, and the time law of targets.

    ``start_ns`` is when the phase began, with joints (n,) rad and tools as they were. ``grasp_frame`` is
    where ``holder`` has the deputy; ``deputy_in_world`` is where it was last. ``corrections`` tell by arm how
    far off the targets at ``stamp_ns`` were what was expected: a shift in ``world``, and a turn of its axes;
    ``drifts`` how these change, on average of the latest time.
    """

    phase: TaskPhase
    stamp_ns: int
    start_ns: int
    joints_at_start: Array
    tools_at_start: Mapping[str, Pose]
    holder: str
    grasp_frame: str
    deputy_in_world: Pose
    time_law: str
    corrections: Mapping[str, Pose]
    drifts: Mapping[str, Twist]

    def __post_init__(self) -> None:
        freeze(self, "joints_at_start")
        for name in ("tools_at_start", "corrections", "drifts"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
