"""Generator of the trajectory: schedule and current state to targets and joint reference."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from sms_handover.graph.events import RunEvent
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.known_payload import EMPTY_HANDS, Grip, KnownPayload
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.deputy_twist import Before, DeputyTwist, twist_at
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
from sms_handover.trajectory.tool_motion import PinocchioToolMotion, ToolMotion
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
class Course:
    """What leads the arms in quiet periods: the phase, and where its motion begins and ends.

    The tools of some arms go from ``starts`` to ``goals`` in ``world``, or to poses in the deputy wherever it
    is; the joints (n,) rad of those in ``by_joints`` from ``joints`` to ``ends``; those of the others stay at
    ``joints``. ``progress`` (k, 2) has the fraction of the motion and its rate in 1/s for each period;
    ``damping`` is that of the generalised Jacobian. With ``has_momentum`` a deputy with mass may have given
    the robot some.
    """

    phase: TaskPhase
    starts: Mapping[str, Pose]
    goals: Mapping[str, Pose]
    on_deputy: Mapping[str, pin.SE3]
    by_joints: frozenset[str]
    joints: Array
    ends: Array
    progress: Array
    damping: float
    has_momentum: bool


@dataclass(frozen=True, eq=False)
class GeneratorState:
    """Progress of the task, joints (n,) rad and tools as the phase began, who holds the deputy, where it was.

    ``deputy_before`` is None unless the motion of the deputy is followed.
    """

    progress: ProgressState
    joints_at_start: Array
    tools_at_start: Mapping[str, Pose]
    grip: Grip = EMPTY_HANDS
    deputy_before: Before | None = None


class TrajectoryGenerator:
    """Follows a schedule; each reference period it gives targets, an IK request and a reference.

    Inverse kinematics is solved by the caller: in the graph it is a service.
    """

    def __init__(
        self,
        robot: RobotModel,
        schedule: Schedule,
        parameters: TrajectoryParameters,
        make_motion: Callable[[RobotModel], ToolMotion] = PinocchioToolMotion,
        *,
        abort_on_collision: bool = False,
        fail_on_touch: bool = False,
    ) -> None:
        """Follow a schedule; ``make_motion`` makes what leads the tools of a robot."""
        self._robot = robot
        self._make_motion = make_motion
        self._payload = KnownPayload(robot, schedule.deputy)
        self._motion = make_motion(robot)
        self._deputy_twist = DeputyTwist(schedule.deputy)
        self._schedule = schedule
        self._progress = TaskProgress(
            schedule, parameters, abort_on_collision=abort_on_collision, fail_on_touch=fail_on_touch
        )
        self._time_law = TIME_LAWS[parameters.time_law]
        self._damping = parameters.jacobian_damping
        self.reset()

    def reset(self) -> None:
        """Return to the start of the schedule."""
        self._progress.reset()
        self._hold(EMPTY_HANDS)
        self._deputy_twist.before = None
        self._joints_at_start: Array = np.zeros(self._robot.n_joints)
        self._tools_at_start: Mapping[str, Pose] = {}

    def snapshot(self) -> GeneratorState:
        """Return the state to :meth:`restore`."""
        joints, tools = read_only(self._joints_at_start), dict(self._tools_at_start)
        before = self._deputy_twist.before
        return GeneratorState(self._progress.snapshot(), joints, tools, self._payload.grip, before)

    def restore(self, state: GeneratorState) -> None:
        """Go back to a former state; raises ConfigurationError if it is that of another schedule."""
        self._progress.restore(state.progress)
        self._hold(state.grip)
        self._deputy_twist.before = state.deputy_before
        self._joints_at_start, self._tools_at_start = state.joints_at_start, state.tools_at_start

    def targets(self, state: RobotState, deputy_in_world: Pose) -> tuple[TaskPhase, Targets]:
        """Return the current phase and the targets of the arms; starts the next phase when it is due."""
        stage = self._progress.at(state.stamp_ns)
        if stage.begins:
            self._joints_at_start = state.joint_position
            self._tools_at_start = self._motion.tools_at(state.q)
        return stage.task, self._targets_of(stage, state, deputy_in_world)

    @property
    def awaits_grasps(self) -> bool:
        """Whether the outcome of a command is still unknown."""
        return self._progress.awaits_grasps

    def grasped(self, events: Iterable[GraspEvent]) -> None:
        """Record outcomes of grasp commands; a payload counts from the next period on."""
        told = tuple(events)
        self._progress.grasped(told)
        if any([self._payload.grasped(event) for event in told]):
            self._motion = self._make_motion(self._payload.robot)

    def collided(self, collisions: Iterable[Collision]) -> None:
        """Record which bodies collide in this period."""
        self._progress.collided(collisions)

    def solved(self, *, converged: bool) -> None:
        """Record whether IK converged for the latest targets."""
        self._progress.solved(converged=converged)

    def take_decisions(self) -> tuple[RunEvent, ...]:
        """Return the decisions about the task since the last call."""
        return self._progress.take_decisions()

    @property
    def ik_failures(self) -> tuple[int, int]:
        """The latest targets in a row that inverse kinematics has not reached, and the number that fails."""
        return self._progress.ik_failures

    def went_quietly(self, stamp_ns: int, deputy_in_world: Pose, ik_failures: int) -> None:
        """Go on after quiet periods, of which the last began at a time.

        The deputy was at a pose then, and so many of the latest targets in a row were not reached.
        """
        self._deputy_twist.at(stamp_ns, deputy_in_world)
        self._progress.failed_so_far(ik_failures)

    def quiet_until(self, stamp_ns: int) -> int | None:
        """Return up to when nothing has to be decided, None if not even now.

        A deputy that moves by itself is followed by its twist, which is worked out period by period.
        """
        quiet = self._progress.quiet_from(stamp_ns)
        if quiet is None or not self._deputy_twist.follows:
            return quiet
        targets = self._progress.at(stamp_ns).targets.values()
        return None if any(isinstance(target, GraspFrameTarget) for target in targets) else quiet

    def course(self, stamp_ns: int, period_ns: int, count: int) -> Course:
        """Return what leads the arms in some quiet periods from a time on, the first of ``count``."""
        stage = self._progress.at(stamp_ns)
        motion_s = ns_to_seconds(stage.phase.motion_ns)
        progress = np.empty((count, 2))
        for index in range(count):
            elapsed_ns = stamp_ns + index * period_ns - stage.start_ns
            done = self._time_law(ns_to_seconds(elapsed_ns), motion_s)
            progress[index] = done.fraction, done.rate
        goals, ends = dict[str, Pose](), np.array(self._joints_at_start)
        on_deputy = dict[str, pin.SE3]()
        moved = set[str]()
        for arm, target in stage.targets.items():
            if isinstance(target, ToolTarget):
                goals[arm] = target.tool_in_world
            elif isinstance(target, GraspFrameTarget):
                frame, in_frame = _on_deputy(target, self._schedule.deputy)
                on_deputy[arm] = frame * in_frame
            elif isinstance(target, JointTarget):
                moved.add(arm)
                ends[self._robot.arm_joints[arm]] = target.position
        return Course(
            stage.task,
            self._tools_at_start,
            goals,
            on_deputy,
            frozenset(moved),
            self._joints_at_start,
            ends,
            progress,
            self._damping,
            self._payload.has_mass,
        )

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
        [Umetani1989], of the robot with its payload, and less what its momentum gives the tools anyway.
        """
        robot, led = self._robot, targets.tool_in_world
        others = [arm for arm in robot.arms if arm not in led]
        at = robot.configuration(state.base_in_world, joint_position)
        by_joints = self._motion.tools_at(at, others) if others else {}
        velocity, twists = targets.joint_velocity, targets.tool_twist_in_world
        if self._payload.has_mass:
            twists = self._motion.without_drift(state.q, state.v, twists)
        if any(_moves(twist) for twist in twists.values()):
            velocity = self._motion.resolved(state.q, twists, velocity, self._damping)
        reference = JointReference(state.stamp_ns, joint_position, velocity)
        return reference, {arm: led[arm] if arm in led else by_joints[arm] for arm in robot.arms}

    def _hold(self, grip: Grip) -> None:
        """Go on with who holds the deputy."""
        if grip != self._payload.grip:
            self._payload.hold(grip)
            self._motion = self._make_motion(self._payload.robot)

    def _goal(self, target: ToolTarget | GraspFrameTarget, deputy_in_world: Pose) -> Pose:
        """Return where a tool is to be in ``world``."""
        if isinstance(target, ToolTarget):
            return target.tool_in_world
        return self._motion.placed(deputy_in_world, *_on_deputy(target, self._schedule.deputy))

    def _targets_of(self, stage: Stage, state: RobotState, deputy_in_world: Pose) -> Targets:
        """Return the targets of every arm at the time of a state."""
        progress = self._time_law(
            ns_to_seconds(state.stamp_ns - stage.start_ns), ns_to_seconds(stage.phase.motion_ns)
        )
        poses: dict[str, Pose] = {}
        twists: dict[str, Twist] = {}
        deputy_twist = self._deputy_twist.at(state.stamp_ns, deputy_in_world)
        position = np.array(state.joint_position)
        velocity = np.zeros(self._robot.n_joints)
        for arm, target in stage.targets.items():
            joints = self._robot.arm_joints[arm]
            start = self._joints_at_start[joints]
            match target:
                case ToolTarget() | GraspFrameTarget():
                    goal = self._goal(target, deputy_in_world)
                    tool = self._tools_at_start[arm]
                    if deputy_twist and isinstance(target, GraspFrameTarget):
                        moves = twist_at(deputy_twist, deputy_in_world.position, goal.position)
                        poses[arm], twists[arm] = PosePath(tool, goal, moves).at(progress)
                    else:
                        poses[arm], twists[arm] = self._motion.on_path(tool, goal, progress)
                case JointTarget():
                    position[joints], velocity[joints] = _joint_motion(start, target.position, progress)
                case Hold():
                    position[joints] = start
        return Targets(state.stamp_ns, poses, twists, frozen(position), frozen(velocity))


def _on_deputy(target: GraspFrameTarget, deputy: DeputyDescription) -> tuple[pin.SE3, pin.SE3]:
    """Return the grasp frame of a target in the deputy, and the tool in it."""
    return se3_of(deputy.grasp_frames[target.grasp_frame]), se3_of(target.tool_in_grasp_frame)


def goal_in_world(
    target: ToolTarget | GraspFrameTarget, deputy: DeputyDescription, deputy_in_world: Pose
) -> Pose:
    """Return the target pose of a tool in ``world`` for a pose of the deputy."""
    if isinstance(target, ToolTarget):
        return target.tool_in_world
    frame, in_frame = _on_deputy(target, deputy)
    return pose_of(se3_of(deputy_in_world) * frame * in_frame)


def _joint_motion(start: Array, end: Array, progress: Progress) -> tuple[Array, Array]:
    """Return joint position and velocity on the straight line between two configurations."""
    return start + progress.fraction * (end - start), progress.rate * (end - start)


def _moves(twist: Twist) -> bool:
    """Whether a twist is not zero."""
    return bool(np.count_nonzero(twist.linear) or np.count_nonzero(twist.angular))
