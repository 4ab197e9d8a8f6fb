"""Preview of the targets to come: what phase, schedule and present targets tell about the next seconds."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets, PreviewState
from sms_handover.trajectory.generator import goal_in_world
from sms_handover.trajectory.pose_path import AT_REST, PosePath
from sms_handover.trajectory.schedule import ArmTarget, GraspFrameTarget, Hold, JointTarget, Schedule
from sms_handover.trajectory.target_drift import change_of, low_passed
from sms_handover.trajectory.time_law import TIME_LAWS, Progress
from sms_handover.types import (
    BASE_NQ,
    Array,
    GraspAction,
    GraspEvent,
    GraspStatus,
    JointReference,
    Pose,
    TaskPhase,
    Twist,
)
from sms_handover.units import ns_to_seconds

_CLEARLY = 0.5  # [-] share of the misfit of the time law so far that another must stay below
_BEGINNING = 0.25  # [-] of a motion, in which the time law is looked at
_SAME = 1e-9  # [m + rad] of misfit that is rounding


@dataclass(frozen=True, eq=False)
class _Leg:
    """A phase as far as it moves the arms: from where to where, and when."""

    index: int
    start_ns: int
    end_ns: int
    motion_s: float
    targets: Mapping[str, ArmTarget]
    tools: Mapping[str, Pose]
    goals: Mapping[str, Pose]
    joints: Array
    ends: Array


class TargetPreview:
    """Expects the targets of the generator from what a controller is told, and from the schedule.

    A controller does not hear by which time law targets move, nor where the deputy is: of the time laws that
    one is taken which fits the targets of now best; the deputy is where the schedule has it, then in the
    grasp of the arm that has grasped it, whose tool goes on with the twist of now in its own axes; targets on
    the deputy go with it. What the targets of now are off by, those to come are too, and ever more if that
    drifts. A preview ends where commands are due, as what follows depends on their outcome.
    """

    def __init__(self, robot: RobotModel, schedule: Schedule) -> None:
        """Follow a schedule, as known to the controller."""
        self._robot, self._schedule = robot, schedule
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._now: PreviewState | None = None

    @property
    def state(self) -> PreviewState | None:
        """Everything that later previews depend on, besides the next update."""
        return self._now

    def restore(self, state: PreviewState | None) -> None:
        """Go back to a former :attr:`state`."""
        self._now = state

    def update(
        self,
        phase: TaskPhase,
        reference: JointReference,
        tool_in_world: Mapping[str, Pose],
        q: Array,
        v: Array,
    ) -> None:
        """Take the guidance of now, at a configuration (7 + n,) and a velocity (6 + n,)."""
        tools = self._robot.tools_at(q)
        now = self._now
        if now is None or phase.entry != now.phase.entry:
            now = self._begun(phase, q, tools)
        if now.holder:
            frame = se3_of(self._schedule.deputy.grasp_frames[now.grasp_frame])
            held = pose_of(se3_of(tools[now.holder]) * frame.inverse())
            now = replace(now, deputy_in_world=held)
            self._carried = self._robot.tool_motion(q, v, now.holder)
        self._leg, self._joints = self._leg_of(now), q[-self._robot.n_joints :]
        now = replace(now, time_law=self._fitting(now, reference, tool_in_world))
        found = self._corrections_of(now, phase.stamp_ns, tool_in_world)
        since = ns_to_seconds(phase.stamp_ns - now.stamp_ns)
        elapsed, drifts = ns_to_seconds(phase.stamp_ns - now.start_ns), dict(now.drifts)
        for arm in [arm for arm in found if arm in now.corrections and since > 0.0]:
            change = change_of(now.corrections[arm], found[arm], since)
            drifts[arm] = low_passed(drifts.get(arm, AT_REST), change, since, elapsed)
        self._now = replace(now, stamp_ns=phase.stamp_ns, corrections=found, drifts=drifts)
        self._base = q[:BASE_NQ]

    def grasped(self, event: GraspEvent) -> None:
        """Learn what came of a grasp command, between two updates."""
        if self._now and event.status is GraspStatus.SUCCEEDED:
            command = event.command
            released = command.action is GraspAction.RELEASE
            holder, frame = ("", "") if released else (command.arm, command.grasp_frame)
            self._now = replace(self._now, holder=holder, grasp_frame=frame)

    def ahead(self, stamps_ns: Iterable[int]) -> tuple[PreviewedTargets, ...]:
        """Return the targets at some instants in order, from that of the last update on."""
        found, leg = list[PreviewedTargets](), self._leg
        assert self._now is not None
        for stamp_ns in stamps_ns:
            while stamp_ns >= leg.end_ns and (later := self._after(leg)) is not None:
                leg = later
            found.append(self._targets(self._now, leg, stamp_ns))
        return tuple(found)

    def _begun(self, phase: TaskPhase, q: Array, tools: Mapping[str, Pose]) -> PreviewState:
        """Return the state of a phase that begins."""
        now, joints = self._now, q[-self._robot.n_joints :]
        deputy = now.deputy_in_world if now else self._schedule.deputy.deputy_in_world
        law = now.time_law if now else next(iter(TIME_LAWS))
        grip = (now.holder, now.grasp_frame) if now else ("", "")
        stamp_ns = phase.stamp_ns
        return PreviewState(phase, stamp_ns, stamp_ns, joints, tools, *grip, deputy, law, {}, {})

    def _leg_of(self, now: PreviewState) -> _Leg:
        """Return the leg of the phase of now."""
        phase = self._schedule.phases[now.phase.index]
        targets = {arm: Hold() for arm in phase.targets} if now.phase.failed else phase.targets
        end_ns = now.start_ns + phase.end_ns - phase.start_ns
        return self._leg_from(now, now.phase.index, end_ns, targets, now.tools_at_start, now.joints_at_start)

    def _after(self, leg: _Leg) -> _Leg | None:
        """Return the leg after another, None where that is not known yet."""
        now, following = self._now, leg.index + 1
        assert now is not None
        if now.phase.failed or following == len(self._schedule.phases):
            return None
        phase = self._schedule.phases[following]
        if phase.commands:
            return None
        end_ns = leg.end_ns + phase.end_ns - phase.start_ns
        tools = {**self._robot.tools_at(np.concatenate([self._base, leg.ends])), **leg.goals}
        joints = np.array(leg.ends)
        for arm in leg.goals:  # where inverse kinematics will take it is not known
            joints[self._robot.arm_joints[arm]] = self._joints[self._robot.arm_joints[arm]]
        later = self._leg_from(now, following, end_ns, phase.targets, tools, joints, leg.end_ns)
        held = {arm: leg.goals[arm] for arm in leg.goals if isinstance(phase.targets[arm], Hold)}
        return replace(later, goals={**later.goals, **held})

    def _leg_from(
        self,
        now: PreviewState,
        index: int,
        end_ns: int,
        targets: Mapping[str, ArmTarget],
        tools: Mapping[str, Pose],
        joints: Array,
        start_ns: int | None = None,
    ) -> _Leg:
        """Return the leg of a phase from where tools and joints are when it begins."""
        goals, ends = dict[str, Pose](), np.array(joints)
        for arm, target in targets.items():
            if isinstance(target, JointTarget):
                ends[self._robot.arm_joints[arm]] = target.position
            elif not isinstance(target, Hold):
                goals[arm] = goal_in_world(target, self._schedule.deputy, now.deputy_in_world)
        begun_ns = now.start_ns if start_ns is None else start_ns
        motion_s = ns_to_seconds(self._schedule.phases[index].motion_ns)
        return _Leg(index, begun_ns, end_ns, motion_s, targets, tools, goals, joints, ends)

    def _fitting(
        self, now: PreviewState, reference: JointReference, tool_in_world: Mapping[str, Pose]
    ) -> str:
        """Return the time law whose targets are nearest to those of now, that of before if several are.

        Only where a motion begins do time laws differ so much that nothing else can be the reason.
        """
        elapsed_s = ns_to_seconds(reference.stamp_ns - self._leg.start_ns)
        if elapsed_s > _BEGINNING * self._leg.motion_s:
            return now.time_law
        misfit = {law: self._misfit(law, now, reference, tool_in_world) for law in TIME_LAWS}
        best = min(misfit, key=misfit.__getitem__)
        return best if misfit[best] < _CLEARLY * misfit[now.time_law] - _SAME else now.time_law

    def _misfit(
        self, law: str, now: PreviewState, reference: JointReference, tool_in_world: Mapping[str, Pose]
    ) -> float:
        """Return how far the targets under a time law are from those of now, in m + rad."""
        leg, misfit = self._leg, 0.0
        done = _progress(law, leg, reference.stamp_ns)
        for arm, goal in leg.goals.items():
            pose = PosePath(leg.tools[arm], goal).at(done)[0]
            misfit += sum(pose_distance(pose, tool_in_world[arm]))
        for arm, target in leg.targets.items():
            if isinstance(target, JointTarget):
                part = self._robot.arm_joints[arm]
                expected = leg.joints[part] + done.fraction * (leg.ends[part] - leg.joints[part])
                misfit += float(np.abs(expected - reference.position[part]).sum())
        return misfit

    def _corrections_of(
        self, now: PreviewState, stamp_ns: int, tool_in_world: Mapping[str, Pose]
    ) -> Mapping[str, Pose]:
        """Return by how much the targets of now are off."""
        done, found = _progress(now.time_law, self._leg, stamp_ns), dict[str, Pose]()
        for arm, goal in self._leg.goals.items():
            expected, given = PosePath(self._leg.tools[arm], goal).at(done)[0], tool_in_world[arm]
            turn = se3_of(given).rotation @ se3_of(expected).rotation.T
            found[arm] = pose_of(pin.SE3(turn, given.position - expected.position))
        return found

    def _moved(self, now: PreviewState, leg: _Leg, arm: str, goal: Pose, stamp_ns: int) -> tuple[Pose, Twist]:
        """Return where the goal of an arm is at an instant, and its twist, both in ``world``.

        On a deputy that is held it goes with the tool of the holder.
        """
        if not now.holder or not isinstance(leg.targets[arm], GraspFrameTarget):
            return goal, AT_REST
        pose, twist = self._carried
        tool, ahead = se3_of(pose), ns_to_seconds(stamp_ns - now.stamp_ns)
        along = pin.Motion(tool.rotation.T @ twist.linear, tool.rotation.T @ twist.angular)
        later = tool * pin.exp6(ahead * along)
        moved = later * tool.inverse() * se3_of(goal)
        angular = later.rotation @ along.angular
        linear = later.rotation @ along.linear + np.cross(angular, moved.translation - later.translation)
        return pose_of(moved), Twist(linear, angular)

    def _targets(self, now: PreviewState, leg: _Leg, stamp_ns: int) -> PreviewedTargets:
        """Return the targets of a leg at an instant."""
        done, tools, twists = _progress(now.time_law, leg, stamp_ns), dict[str, Pose](), dict[str, Twist]()
        for arm, goal in leg.goals.items():
            end, end_twist = self._moved(now, leg, arm, goal, stamp_ns)
            pose, twist = PosePath(leg.tools[arm], end, end_twist).at(done)
            if arm in now.corrections:
                ahead, drift = ns_to_seconds(stamp_ns - now.stamp_ns), now.drifts.get(arm, AT_REST)
                turn = pin.exp3(ahead * drift.angular) @ se3_of(now.corrections[arm]).rotation
                shift = now.corrections[arm].position + ahead * drift.linear
                pose = pose_of(pin.SE3(turn @ se3_of(pose).rotation, pose.position + shift))
                twist = Twist(twist.linear + drift.linear, turn @ twist.angular + drift.angular)
            tools[arm], twists[arm] = pose, twist
        rates = done.rate * (leg.ends - leg.joints)
        joints = leg.joints + done.fraction * (leg.ends - leg.joints)
        aims = {arm for arm, target in leg.targets.items() if isinstance(target, GraspFrameTarget)}
        phases, following = self._schedule.phases, leg.index + 1
        due = phases[following].commands if following < len(phases) else ()
        commanded = {arm for one in (*now.phase.commands, *due) for arm in (one.arm, one.from_arm)}
        touching = frozenset(aims | commanded | {now.holder}) - {""}
        if now.holder:
            frame = self._schedule.deputy.grasp_frames[now.grasp_frame]
            held = pose_of(se3_of(frame).inverse())
            return PreviewedTargets(tools, twists, joints, rates, now.holder, held, touching)
        return PreviewedTargets(tools, twists, joints, rates, "", now.deputy_in_world, touching)


def _progress(law: str, leg: _Leg, stamp_ns: int) -> Progress:
    """Return the progress of a leg at an instant under a time law."""
    return TIME_LAWS[law](ns_to_seconds(stamp_ns - leg.start_ns), leg.motion_s)
