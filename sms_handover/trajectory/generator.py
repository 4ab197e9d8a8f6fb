"""Generator of the trajectory: schedule and current state to targets and joint reference."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from sms_handover.graph.events import RunEvent
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.reduced import generalized_jacobian
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.trajectory.pose_path import PosePath
from sms_handover.trajectory.schedule import (
    GraspFrameTarget,
    Hold,
    JointTarget,
    Schedule,
    ToolTarget,
)
from sms_handover.trajectory.task_progress import ProgressState, Stage, TaskProgress
from sms_handover.trajectory.time_law import TIME_LAWS, Progress
from sms_handover.types import (
    Array,
    Collision,
    GraspEvent,
    IkRequest,
    JointReference,
    Pose,
    RobotState,
    TaskPhase,
    Twist,
    freeze,
    frozen,
    read_only,
)
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets of the arms at one instant.

    Arms led by their tool have pose and twist in ``world``; ``joint_position`` and ``joint_velocity``
    (n,) have the desired joints of the others, and the current ones of arms led by their tool.
    """

    stamp_ns: int
    tool_in_world: Mapping[str, Pose]
    tool_twist_in_world: Mapping[str, Twist]
    joint_position: Array
    joint_velocity: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_in_world", MappingProxyType(dict(self.tool_in_world)))
        object.__setattr__(self, "tool_twist_in_world", MappingProxyType(dict(self.tool_twist_in_world)))
        freeze(self, "joint_position", "joint_velocity")


@dataclass(frozen=True, eq=False)
class GeneratorState:
    """Progress of the task, and where joints (n,) rad and tools were when the phase began."""

    progress: ProgressState
    joints_at_start: Array
    tools_at_start: Mapping[str, Pose]


class TrajectoryGenerator:
    """Follows a schedule; each reference period it gives targets, an IK request and a reference.

    Inverse kinematics is solved by the caller: in the graph it is a service.
    """

    def __init__(
        self,
        robot: RobotModel,
        schedule: Schedule,
        parameters: TrajectoryParameters,
        *,
        abort_on_collision: bool = False,
    ) -> None:
        self._robot = robot
        self._schedule = schedule
        self._progress = TaskProgress(schedule, parameters, abort_on_collision=abort_on_collision)
        self._time_law = TIME_LAWS[parameters.time_law]
        self._damping = parameters.jacobian_damping
        self.reset()

    def reset(self) -> None:
        """Return to the start of the schedule."""
        self._progress.reset()
        self._joints_at_start: Array = np.zeros(self._robot.n_joints)
        self._tools_at_start: Mapping[str, Pose] = {}

    def snapshot(self) -> GeneratorState:
        """Return the state to :meth:`restore`."""
        return GeneratorState(
            self._progress.snapshot(), read_only(self._joints_at_start), dict(self._tools_at_start)
        )

    def restore(self, state: GeneratorState) -> None:
        """Go back to a former state; raises ConfigurationError if it is that of another schedule."""
        self._progress.restore(state.progress)
        self._joints_at_start, self._tools_at_start = state.joints_at_start, state.tools_at_start

    def targets(self, state: RobotState, deputy_in_world: Pose) -> tuple[TaskPhase, Targets]:
        """Return the current phase and the targets of the arms; starts the next phase when it is due."""
        stage = self._progress.at(state.stamp_ns)
        if stage.begins:
            self._joints_at_start = state.joint_position
            self._tools_at_start = self._robot.tools_at(state.q)
        return stage.task, self._targets_of(stage, state, deputy_in_world)

    @property
    def awaits_grasps(self) -> bool:
        """Whether the outcome of a command is still unknown."""
        return self._progress.awaits_grasps

    def grasped(self, events: Iterable[GraspEvent]) -> None:
        """Record outcomes of grasp commands."""
        self._progress.grasped(events)

    def collided(self, collisions: Iterable[Collision]) -> None:
        """Record which bodies collide in this period."""
        self._progress.collided(collisions)

    def solved(self, *, converged: bool) -> None:
        """Record whether IK converged for the latest targets."""
        self._progress.solved(converged=converged)

    def take_decisions(self) -> tuple[RunEvent, ...]:
        """Return the decisions about the task since the last call."""
        return self._progress.take_decisions()

    def ik_request(self, state: RobotState, targets: Targets) -> IkRequest:
        """Return the IK request: the base locked at its pose, the current joints as seed.

        Arms led by their joints have their desired joints there.
        """
        return IkRequest(state.base_in_world, targets.joint_position, targets.tool_in_world)

    def reference(
        self, state: RobotState, targets: Targets, joint_position: Array
    ) -> tuple[JointReference, Mapping[str, Pose]]:
        """Return the joint reference for the joint angles of IK, and the target pose of every tool.

        For arms led by their joints that is the pose at these joints. The joint rates give the desired
        tool twists including the reaction of the base: the damped inverse of the generalised Jacobian
        [Umetani1989].
        """
        robot, led = self._robot, targets.tool_in_world
        others = [arm for arm in robot.arms if arm not in led]
        by_joints = robot.tools_in_world(state.base_in_world, joint_position, others) if others else {}
        velocity = targets.joint_velocity
        if any(_moves(twist) for twist in targets.tool_twist_in_world.values()):
            velocity = self._resolve_rates(state, targets, velocity)
        reference = JointReference(state.stamp_ns, joint_position, velocity)
        return reference, {arm: led[arm] if arm in led else by_joints[arm] for arm in robot.arms}

    def _targets_of(self, stage: Stage, state: RobotState, deputy_in_world: Pose) -> Targets:
        """Return the targets of every arm at the time of a state."""
        progress = self._time_law(
            ns_to_seconds(state.stamp_ns - stage.start_ns), ns_to_seconds(stage.phase.motion_ns)
        )
        poses: dict[str, Pose] = {}
        twists: dict[str, Twist] = {}
        position = np.array(state.joint_position)
        velocity = np.zeros(self._robot.n_joints)
        for arm, target in stage.targets.items():
            joints = self._robot.arm_joints[arm]
            start = self._joints_at_start[joints]
            match target:
                case ToolTarget() | GraspFrameTarget():
                    goal = goal_in_world(target, self._schedule.deputy, deputy_in_world)
                    poses[arm], twists[arm] = PosePath(self._tools_at_start[arm], goal).at(progress)
                case JointTarget():
                    position[joints], velocity[joints] = _joint_motion(start, target.position, progress)
                case Hold():
                    position[joints] = start
        return Targets(state.stamp_ns, poses, twists, frozen(position), frozen(velocity))

    def _resolve_rates(self, state: RobotState, targets: Targets, velocity: Array) -> Array:
        """Return the joint rates, those of tool-led arms resolved from the desired twists."""
        robot = self._robot
        led = [arm for arm in robot.arms if arm in targets.tool_twist_in_world]
        jacobian = generalized_jacobian(robot, state.q, *led)
        twists = [targets.tool_twist_in_world[arm] for arm in led]
        wanted = np.concatenate([part for t in twists for part in (t.linear, t.angular)])
        columns = np.concatenate([np.arange(robot.n_joints)[robot.arm_joints[arm]] for arm in led])
        free = jacobian[:, columns]
        rest = wanted - jacobian @ velocity  # the other arms move the tool through the base
        damped = free @ free.T + self._damping**2 * np.eye(rest.size)
        result = np.array(velocity)
        result[columns] = free.T @ np.linalg.solve(damped, rest)
        return frozen(result)


def goal_in_world(
    target: ToolTarget | GraspFrameTarget, deputy: DeputyDescription, deputy_in_world: Pose
) -> Pose:
    """Return the target pose of a tool in ``world`` for a pose of the deputy."""
    if isinstance(target, ToolTarget):
        return target.tool_in_world
    frame = deputy.grasp_frames[target.grasp_frame]
    return pose_of(se3_of(deputy_in_world) * se3_of(frame) * se3_of(target.tool_in_grasp_frame))


def _joint_motion(start: Array, end: Array, progress: Progress) -> tuple[Array, Array]:
    """Return joint position and velocity on the straight line between two configurations."""
    return start + progress.fraction * (end - start), progress.rate * (end - start)


def _moves(twist: Twist) -> bool:
    """Whether a twist is not zero."""
    return bool(np.count_nonzero(twist.linear) or np.count_nonzero(twist.angular))
