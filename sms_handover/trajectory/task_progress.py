"""Progress of a task in its schedule, with phases that are repeated or fail."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import nan

from sms_handover.errors import ConfigurationError
from sms_handover.frames import DEPUTY
from sms_handover.graph.events import (
    COLLISION,
    GRASP_FAILED,
    GRASP_MISSED,
    IK_FAILED,
    PHASE_RETRIED,
    TOUCH,
    RunEvent,
    Severity,
)
from sms_handover.graph.topics import TRAJECTORY
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.trajectory.schedule import ArmTarget, Hold, MissAction, Phase, Schedule
from sms_handover.types import (
    Collision,
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    PhaseState,
    TaskPhase,
)
from sms_handover.units import seconds_to_ns

Figures = tuple[float, float, str]  # value, limit, unit


@dataclass(frozen=True, eq=False)
class Stage:
    """The state of the task at one instant: phase, its start and targets, whether it begins now."""

    task: TaskPhase
    phase: Phase
    start_ns: int
    targets: Mapping[str, ArmTarget]
    begins: bool


@dataclass
class _Issue:
    """The commands of a phase, and their outcomes so far."""

    index: int
    commands: tuple[GraspCommand, ...]
    answers: dict[GraspCommand, GraspEvent] = field(default_factory=dict)

    @property
    def answered(self) -> bool:
        """Whether the outcome of every command is known."""
        return len(self.answers) == len(self.commands)

    @property
    def missed(self) -> list[GraspEvent]:
        """Outcomes of the commands that did not succeed."""
        return [event for event in self.answers.values() if event.status is not GraspStatus.SUCCEEDED]


@dataclass(frozen=True, eq=False)
class ProgressState:
    """Everything that the later progress of a task depends on, once its decisions have been taken.

    Per phase: the commands ``due``, how often it has ``begun``, its ``retries``. ``issues`` has the phase
    index, the commands and the answers of every issue; ``colliding`` the groups of bodies that collided in
    the period before that of ``collisions``; ``held`` tells whether an arm holds the deputy.
    """

    shift_ns: int
    end_ns: int
    failed: bool
    now: tuple[int, bool] | None
    due: tuple[tuple[GraspCommand, ...], ...]
    begun: tuple[int, ...]
    retries: tuple[int, ...]
    issues: tuple[tuple[int, tuple[GraspCommand, ...], tuple[GraspEvent, ...]], ...]
    ik_failures: int
    collisions: tuple[Collision, ...]
    colliding: tuple[str, ...]
    held: bool = False


class TaskProgress:
    """Follows a schedule, depending on the outcomes of grasps and of inverse kinematics.

    A miss is handled as ``on_miss`` of its phase says. A retry repeats the phase before, from where the
    robot is, then the phase itself with those of its commands that have not succeeded; everything later
    shifts by that time. A collision is reported when it begins, or fails the phase. A phase that fails holds
    the joints, and the task ends ``failure_hold`` later.
    Decisions are made on reference periods, so that a run depends on nothing else.
    """

    def __init__(
        self,
        schedule: Schedule,
        parameters: TrajectoryParameters,
        *,
        abort_on_collision: bool = False,
        fail_on_touch: bool = False,
    ) -> None:
        self._schedule, self._abort_on_collision = schedule, abort_on_collision
        self._fail_on_touch = fail_on_touch
        self._most_ik_failures = parameters.ik_failures
        self._failure_hold_ns = seconds_to_ns(parameters.failure_hold)
        self.reset()

    def reset(self) -> None:
        """Return to the start of the schedule."""
        phases = self._schedule.phases
        self._shift_ns = 0
        self._end_ns = self._schedule.end_ns
        self._failed = False
        self._now: tuple[int, bool] | None = None
        self._due = [phase.commands for phase in phases]
        self._begun = [0 for _ in phases]
        self._retries = [0 for _ in phases]
        self._issues: list[_Issue] = []
        self._ik_failures = 0
        self._collisions: tuple[Collision, ...] = ()
        self._colliding: tuple[str, ...] = ()
        self._held = False
        self._decisions: list[RunEvent] = []

    def snapshot(self) -> ProgressState:
        """Return the state to :meth:`restore`."""
        return ProgressState(
            self._shift_ns,
            self._end_ns,
            self._failed,
            self._now,
            tuple(self._due),
            tuple(self._begun),
            tuple(self._retries),
            tuple((issue.index, issue.commands, tuple(issue.answers.values())) for issue in self._issues),
            self._ik_failures,
            self._collisions,
            self._colliding,
            self._held,
        )

    def restore(self, state: ProgressState) -> None:
        """Go back to a former state; raises ConfigurationError if it is that of another schedule."""
        if len(state.due) != len(self._due):
            raise ConfigurationError(
                f"the snapshot has {len(state.due)} phases, must have the {len(self._due)} of the schedule"
            )
        self._shift_ns, self._end_ns, self._failed = state.shift_ns, state.end_ns, state.failed
        self._now, self._ik_failures = state.now, state.ik_failures
        self._collisions, self._colliding, self._held = state.collisions, state.colliding, state.held
        self._due, self._begun, self._retries = list(state.due), list(state.begun), list(state.retries)
        self._issues = [
            _Issue(index, commands, {event.command: event for event in answers})
            for index, commands, answers in state.issues
        ]
        self._decisions = []

    @property
    def ik_failures(self) -> tuple[int, int]:
        """The latest targets in a row that inverse kinematics has not reached, and the number that fails."""
        return self._ik_failures, 0 if self._failed else self._most_ik_failures

    def failed_so_far(self, ik_failures: int) -> None:
        """Record how many of the latest targets in a row were not reached."""
        self._ik_failures = ik_failures

    def quiet_from(self, stamp_ns: int) -> int | None:
        """Return the end of the present phase, None if a decision may be due at this time.

        Up to the end of the phase none is due as long as no grasp is commanded and not too many targets are
        out of reach.
        """
        failures, most = self.ik_failures
        if self._now is None or self._issues or self._collisions or 0 < most <= failures:
            return None
        index, failed = self._now
        phase, shift_ns = self._schedule.phases[index], self._shift_ns
        end_ns = self._end_ns if failed else phase.end_ns + shift_ns
        start_ns = phase.start_ns + shift_ns
        return end_ns if failed or start_ns < stamp_ns < end_ns else None

    @property
    def awaits_grasps(self) -> bool:
        """Whether the outcome of a command is still unknown."""
        return any(not issue.answered for issue in self._issues)

    def grasped(self, events: Iterable[GraspEvent]) -> None:
        """Record outcomes of commands; in real time perhaps after the next phase has begun."""
        for event in events:
            issue = next((i for i in self._issues if event.command in i.commands and not i.answered), None)
            if issue is not None:
                issue.answers[event.command] = event
            if event.status is GraspStatus.SUCCEEDED:
                self._held = event.command.action is not GraspAction.RELEASE

    def solved(self, *, converged: bool) -> None:
        """Record whether IK converged for the latest targets."""
        self._ik_failures = 0 if converged else self._ik_failures + 1

    def collided(self, collisions: Iterable[Collision]) -> None:
        """Record which bodies collide, once each period in which clearance is measured."""
        self._collisions = tuple(collisions)

    def take_decisions(self) -> tuple[RunEvent, ...]:
        """Return the decisions since the last call."""
        taken, self._decisions = tuple(self._decisions), []
        return taken

    def at(self, stamp_ns: int) -> Stage:
        """Return the stage at a time, after deciding on the outcomes recorded since the last call."""
        if not self._failed:
            self._decide(stamp_ns)
        if self._failed and self._now:
            index = self._now[0]
        else:
            index = self._schedule.phase_index(stamp_ns - self._shift_ns)
        begins = self._now != (index, self._failed)
        self._now = index, self._failed
        phase = self._schedule.phases[index]
        commands = self._begin(index) if begins and not self._failed else ()
        state = PhaseState.FAILED if self._failed else PhaseState.ACTIVE
        task = TaskPhase(stamp_ns, index, phase.name, commands, state, self._begun[index], self._end_ns)
        targets = {arm: Hold() for arm in phase.targets} if self._failed else phase.targets
        return Stage(task, phase, phase.start_ns + self._shift_ns, targets, begins)

    def _begin(self, index: int) -> tuple[GraspCommand, ...]:
        """Begin a phase and return its commands that are still due."""
        self._begun[index] += 1
        commands, self._due[index] = self._due[index], ()
        if commands:
            self._issues.append(_Issue(index, commands))
        self._ik_failures = 0
        return commands

    def _decide(self, stamp_ns: int) -> None:
        """Decide on grasps that did not succeed, and on targets that are not reached."""
        if self._now is None:
            return
        index = self._now[0]
        self._on_collisions(stamp_ns, index)
        for issue in [issue for issue in self._issues if issue.answered]:
            if issue in self._issues and not self._failed:
                self._issues.remove(issue)
                self._on_answers(stamp_ns, issue)
        if not self._failed and 0 < self._most_ik_failures <= self._ik_failures:
            detail = "inverse kinematics has not converged so many times in a row; the joints are held"
            figures = (self._ik_failures, self._most_ik_failures, "reference periods")
            self._fail(stamp_ns, index, IK_FAILED, detail, figures)

    def _on_collisions(self, stamp_ns: int, index: int) -> None:
        """Report collisions that have begun, or give the task up at the first, or at the first touch.

        A touch is a collision with a deputy that floats: it would push the deputy away, which the plant does
        not model.
        """
        for collision in self._collisions:
            if self._failed or collision.group in self._colliding:
                continue
            figures = (collision.distance, collision.allowed, "m")
            if self._fail_on_touch and not self._held and DEPUTY in collision.bodies:
                detail = f"{collision}, which would push the free deputy away; the joints are held"
                self._fail(stamp_ns, index, TOUCH, detail, figures)
                continue
            if self._abort_on_collision:
                self._fail(stamp_ns, index, COLLISION, f"{collision}; the joints are held", figures)
            else:
                self._report(stamp_ns, index, COLLISION, Severity.WARNING, str(collision), figures)
        self._colliding = tuple(collision.group for collision in self._collisions)

    def _on_answers(self, stamp_ns: int, issue: "_Issue") -> None:
        """Apply the policy of a phase if any of its commands did not succeed."""
        index, missed = issue.index, issue.missed
        if not missed:
            return
        phase, what = self._schedule.phases[index], _in_words(missed[0])
        policy, done = phase.on_miss, self._retries[index]
        can_be_retried = any(event.status is GraspStatus.MISSED for event in missed)
        if policy.action is MissAction.CONTINUE:
            self._report(stamp_ns, index, GRASP_MISSED, Severity.WARNING, f"{what}; the task continues")
        elif policy.action is MissAction.RETRY and can_be_retried and done < policy.retries:
            before = self._schedule.phases[index - 1]
            self._retries[index] += 1
            self._due[index] = tuple(event.command for event in missed)
            self._restore_due()
            self._shift_ns = stamp_ns - before.start_ns
            self._end_ns = self._schedule.end_ns + self._shift_ns
            detail = f"{what}; phase {before.name!r} is repeated"
            self._report(
                stamp_ns,
                index,
                PHASE_RETRIED,
                Severity.WARNING,
                detail,
                (done + 1, policy.retries, "retries"),
            )
        else:
            detail = f"{what}; the joints are held"
            self._fail(stamp_ns, index, GRASP_FAILED, detail, (done + 1, policy.retries + 1, "misses"))

    def _restore_due(self) -> None:
        """Make the commands of later phases due again that began before the miss was known."""
        for later in self._issues:
            succeeded = {c for c, e in later.answers.items() if e.status is GraspStatus.SUCCEEDED}
            self._due[later.index] = tuple(c for c in later.commands if c not in succeeded)
        self._issues.clear()

    def _fail(self, stamp_ns: int, index: int, kind: str, detail: str, figures: Figures) -> None:
        """End the task as failed."""
        self._failed = True
        self._end_ns = stamp_ns + self._failure_hold_ns
        self._report(stamp_ns, index, kind, Severity.ERROR, detail, figures)

    def _report(
        self,
        stamp_ns: int,
        index: int,
        kind: str,
        severity: Severity,
        detail: str,
        figures: Figures = (nan, nan, ""),
    ) -> None:
        """Record a decision."""
        phase, (value, limit, unit) = self._schedule.phases[index].name, figures
        self._decisions.append(
            RunEvent(stamp_ns, TRAJECTORY, kind, severity, detail, phase, float(value), float(limit), unit)
        )


def _in_words(event: GraspEvent) -> str:
    """Return the outcome of a command in words."""
    command = event.command
    return f"{command.action.value} by {command.arm} {event.status.value} ({event.detail})"
