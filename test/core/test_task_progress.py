"""A schedule goes on, is done again in part or is given up by what came of its grasps, to the period."""

from collections.abc import Callable

import pytest

from sms_handover.graph.events import GRASP_FAILED, GRASP_MISSED, IK_FAILED, PHASE_RETRIED, RunEvent, Severity
from sms_handover.trajectory.schedule import Hold
from sms_handover.trajectory.task_progress import Stage, TaskProgress
from sms_handover.types import GraspCommand, GraspEvent, GraspStatus, PhaseState

from .conftest import SCHEDULE, MakeScenario

_PERIOD_NS = 20_000_000
MISSED, REJECTED, SUCCEEDED = GraspStatus.MISSED, GraspStatus.REJECTED, GraspStatus.SUCCEEDED

Verdict = Callable[[GraspCommand, int], GraspStatus]  # by command and how often it has been given


class Walk:
    """The stages and decisions of a whole task in which each command ends as a function says."""

    def __init__(self, progress: TaskProgress, verdict: Verdict, *, converged: Callable[[int], bool]) -> None:
        """Walk to the end of the task."""
        self.stages: list[Stage] = []
        self.decisions: list[RunEvent] = []
        self.given: list[tuple[int, GraspCommand]] = []
        stamp_ns = 0
        while not self.stages or stamp_ns <= self.stages[-1].task.end_ns:
            stage = progress.at(stamp_ns)
            self.stages.append(stage)
            self.decisions += progress.take_decisions()
            for command in stage.task.commands:
                times = sum(command == before for _, before in self.given)
                self.given.append((stamp_ns, command))
                status = verdict(command, times)
                progress.grasped([GraspEvent(stamp_ns, command, status, 0.1, 0.0, 0.0, "why")])
            progress.solved(converged=converged(stamp_ns))
            stamp_ns += _PERIOD_NS

    @property
    def story(self) -> list[tuple[float, str, int, str]]:
        """Return each beginning: time in s, phase, attempt, state."""
        return [
            (s.task.stamp_ns / 1e9, s.task.name, s.task.attempt, s.task.state.value)
            for s in self.stages
            if s.begins
        ]


WalkWith = Callable[..., Walk]


def always(status: GraspStatus) -> Verdict:
    return lambda command, times: status


ALL_SUCCEED = always(SUCCEEDED)


@pytest.fixture
def walk(make_scenario: MakeScenario) -> WalkWith:
    """Return what walks through the small handover with a policy for its phase ``carry`` (0.4 to 1.0 s)."""

    def make(
        on_miss: str = "",
        verdict: Verdict = ALL_SUCCEED,
        *,
        converged: Callable[[int], bool] = lambda stamp_ns: True,
        **trajectory: object,
    ) -> Walk:
        text = SCHEDULE
        if on_miss:
            text = text.replace("  - name: carry\n", f"  - name: carry\n    on_miss: {on_miss}\n")
        scenario = make_scenario(text, trajectory={"failure_hold": 0.1, **trajectory})
        progress = TaskProgress(scenario.truth.schedule, scenario.parameters.trajectory)
        return Walk(progress, verdict, converged=converged)

    return make


PLAIN = [
    (0.0, "approach", 1, "active"),
    (0.4, "carry", 1, "active"),
    (1.0, "withdraw", 1, "active"),
    (1.2, "let go", 1, "active"),
]


@pytest.mark.parametrize("on_miss", ["", "continue", "abort", "{retry: 3}"])
def test_where_every_grasp_succeeds_the_policy_changes_nothing(walk: WalkWith, on_miss: str) -> None:
    done = walk(on_miss)
    assert done.story == PLAIN
    assert done.decisions == []
    assert {stage.task.end_ns for stage in done.stages} == {1_400_000_000}


@pytest.mark.parametrize("on_miss", ["", "continue"])
@pytest.mark.parametrize("status", [MISSED, REJECTED])
def test_continue_goes_on_and_says_so(walk: WalkWith, on_miss: str, status: GraspStatus) -> None:
    done = walk(on_miss, always(status))
    assert done.story == PLAIN
    assert [(e.kind, e.stamp_ns / 1e9, e.phase) for e in done.decisions] == [
        (GRASP_MISSED, 0.42, "carry"),
        (GRASP_MISSED, 1.02, "withdraw"),
        (GRASP_MISSED, 1.22, "let go"),
    ]
    assert {event.severity for event in done.decisions} == {Severity.WARNING}


@pytest.mark.parametrize("status", [MISSED, REJECTED])
def test_abort_holds_the_joints_until_the_task_ends(walk: WalkWith, status: GraspStatus) -> None:
    """Known one period after the command; the end is failure_hold after that."""
    done = walk("abort", always(status))
    assert done.story == [*PLAIN[:2], (0.42, "carry", 1, "failed")]
    assert done.stages[-1].task.stamp_ns == done.stages[-1].task.end_ns == 520_000_000
    assert [(e.kind, e.severity, e.value, e.limit) for e in done.decisions] == [
        (GRASP_FAILED, Severity.ERROR, 1.0, 1.0)
    ]
    for stage in done.stages:
        held = all(isinstance(target, Hold) for target in stage.targets.values())
        assert held is (stage.task.state is PhaseState.FAILED)


@pytest.mark.parametrize("misses", [1, 2, 3])
def test_a_retry_does_the_phase_before_again_and_shifts_the_rest(walk: WalkWith, misses: int) -> None:
    """Each costs the 0.4 s of the approach and the period in which the miss became known."""
    done = walk("{retry: 3}", lambda command, times: MISSED if times < misses else SUCCEEDED)
    again = [
        entry
        for k in range(misses)
        for entry in (
            (pytest.approx(0.42 * (k + 1)), "approach", k + 2, "active"),
            (pytest.approx(0.42 * (k + 1) + 0.4), "carry", k + 2, "active"),
        )
    ]
    later = [(pytest.approx(time + 0.42 * misses), *rest) for time, *rest in PLAIN[2:]]
    # withdraw and let go miss as well, but their policy is to go on
    story: list[object] = [*done.story]
    assert story == [*PLAIN[:2], *again, *later]
    assert done.stages[-1].task.end_ns == 1_400_000_000 + misses * 420_000_000
    retries = [event for event in done.decisions if event.kind == PHASE_RETRIED]
    assert [(e.value, e.limit) for e in retries] == [(k + 1.0, 3.0) for k in range(misses)]


def test_after_the_last_retry_the_task_is_given_up(walk: WalkWith) -> None:
    done = walk("{retry: 2}", always(MISSED))
    assert [event.kind for event in done.decisions] == [PHASE_RETRIED, PHASE_RETRIED, GRASP_FAILED]
    assert done.story[-1][1:] == ("carry", 3, "failed")
    assert done.stages[-1].task.end_ns == 1_260_000_000 + 100_000_000
    assert len(done.given) == 3


def test_what_cannot_be_mended_is_not_tried_again(walk: WalkWith) -> None:
    """A command that makes no sense where things are makes none after another approach."""
    done = walk("{retry: 2}", always(REJECTED))
    assert [event.kind for event in done.decisions] == [GRASP_FAILED]


def test_the_motion_of_a_phase_done_again_begins_anew(walk: WalkWith) -> None:
    done = walk("{retry: 1}", lambda command, times: MISSED if times < 1 else SUCCEEDED)
    for stage in done.stages:
        begun = max(
            s.task.stamp_ns for s in done.stages if s.begins and s.task.stamp_ns <= stage.task.stamp_ns
        )
        assert stage.start_ns == begun


def test_only_what_has_not_succeeded_is_given_again(make_scenario: MakeScenario) -> None:
    """A phase that releases and grasps: the release succeeds, so the retry grasps alone."""
    text = SCHEDULE.replace(
        "      - transfer: {from: arm_a, to: arm_b, grasp_frame: right}\n",
        "      - release: {arm: arm_a}\n      - grasp: {arm: arm_b, grasp_frame: right}\n",
    ).replace("  - name: withdraw\n", "  - name: withdraw\n    on_miss: {retry: 1}\n")
    scenario = make_scenario(text)
    progress = TaskProgress(scenario.truth.schedule, scenario.parameters.trajectory)
    done = Walk(
        progress,
        lambda command, times: MISSED if command.arm == "arm_b" and times == 0 else SUCCEEDED,
        converged=lambda stamp_ns: True,
    )
    given = [(stamp_ns / 1e9, command.action.value, command.arm) for stamp_ns, command in done.given]
    assert given == [
        (0.4, "grasp", "arm_a"),  # and not again, though its phase is done again at 1.02 s
        (1.0, "release", "arm_a"),
        (1.0, "grasp", "arm_b"),
        (1.62, "grasp", "arm_b"),
        (1.82, "release", "arm_b"),
    ]


def test_an_answer_is_waited_for_and_others_are_no_answer(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: abort\n"))
    progress = TaskProgress(scenario.truth.schedule, scenario.parameters.trajectory)
    (command,) = scenario.truth.schedule.phases[1].commands
    (other,) = scenario.truth.schedule.phases[2].commands
    progress.at(0)
    assert not progress.awaits_grasps
    progress.at(400_000_000)
    assert progress.awaits_grasps
    progress.grasped([GraspEvent(0, other, MISSED, 0.0, 0.0, 0.0, "")])
    assert progress.awaits_grasps
    assert progress.at(420_000_000).task.state is PhaseState.ACTIVE  # late in real time: nothing is known
    progress.grasped([GraspEvent(0, command, MISSED, 0.0, 0.0, 0.0, "")])
    assert not progress.awaits_grasps
    assert progress.at(440_000_000).task.state is PhaseState.FAILED


def test_an_answer_that_comes_in_the_next_phase_still_counts(make_scenario: MakeScenario) -> None:
    """In real time on a busy machine: the retry then takes back what the later phase has asked for."""
    text = SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: {retry: 1}\n")
    scenario = make_scenario(text)
    progress = TaskProgress(scenario.truth.schedule, scenario.parameters.trajectory)
    (grasp,), (transfer,) = (phase.commands for phase in scenario.truth.schedule.phases[1:3])
    for stamp_ns in (0, 400_000_000, 1_000_000_000):
        progress.at(stamp_ns)
    progress.grasped([GraspEvent(0, grasp, MISSED, 0.0, 0.0, 0.0, "")])
    again = progress.at(1_020_000_000)
    assert (again.task.name, again.task.attempt, again.task.commands) == ("approach", 2, ())
    assert not progress.awaits_grasps  # of the transfer nothing is waited for any more
    assert progress.at(1_420_000_000).task.commands == (grasp,)
    progress.grasped([GraspEvent(0, grasp, SUCCEEDED, 0.0, 0.0, 0.0, "")])
    assert progress.at(2_020_000_000).task.commands == (transfer,)


@pytest.mark.parametrize("most", [1, 4])
def test_targets_out_of_reach_for_too_long_fail_the_phase(walk: WalkWith, most: int) -> None:
    """From 0.6 s on nothing converges; the n-th failure is known one period after it."""
    done = walk(converged=lambda stamp_ns: stamp_ns < 600_000_000, ik_failures=most)
    assert done.story == [*PLAIN[:2], (pytest.approx(0.6 + 0.02 * most), "carry", 1, "failed")]
    assert [(e.kind, e.value, e.limit) for e in done.decisions] == [(IK_FAILED, most, most)]


def test_a_solve_that_converges_breaks_the_row(walk: WalkWith) -> None:
    """Three failures in a row, again and again, are not four; and never four where 0 is the limit."""
    assert walk(converged=lambda stamp_ns: stamp_ns // _PERIOD_NS % 4 == 0, ik_failures=4).decisions == []
    assert walk(converged=lambda stamp_ns: False, ik_failures=0).decisions == []


def test_reset_forgets_retries_and_failures(make_scenario: MakeScenario) -> None:
    text = SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: {retry: 1}\n")
    scenario = make_scenario(text)
    progress = TaskProgress(scenario.truth.schedule, scenario.parameters.trajectory)
    stories = []
    for _ in range(2):
        done = Walk(progress, always(MISSED), converged=lambda stamp_ns: True)
        stories.append((done.story, done.given, repr(done.decisions)))
        progress.reset()
    assert stories[0] == stories[1]
