from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan

import numpy as np
import pytest

from sms_handover.analysis.claims import Claim, judge
from sms_handover.analysis.clearance import GroupClearance, RunClearance
from sms_handover.analysis.comparison import compare
from sms_handover.analysis.completion import completion
from sms_handover.analysis.metrics import RunMetrics, measure
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.run_data import RunData
from sms_handover.types import Array, GraspAction, GraspEvent, GraspStatus, PhaseState

from .test_analysis_runs import (
    JOINTS,
    NS,
    TICK_NS,
    Path,
    changed,
    grasp,
    line,
    make_run,
    poses,
    second_order,
    turns,
)

STEPS = {"arm_a": {0.0: 0.3, 20.0: 0.2}, "arm_b": {20.0: 0.25, 40.0: 0.4}}
HANDOVER = (grasp(20.0), grasp(40.0, GraspAction.TRANSFER, "arm_b", "arm_a"))


@dataclass(frozen=True)
class Law:
    """What a made-up controller does: its step response, the drift of the base, its largest torque."""

    damping: float = 0.8
    frequency: float = 2.0
    drift: float = 1e-7  # [m/s]
    turn_rate: float = 1e-6  # [rad/s]
    torque: float = 1.5  # [N m]
    offset: float = 0.0  # [m] of arm B's tool at the end, to the side
    angle: float = 0.0  # [rad] of arm B's tool
    events: Sequence[GraspEvent] = HANDOVER
    end: float = 60.0


GOOD = Law()
BAD = Law(damping=0.3, frequency=1.5, drift=5e-5, turn_rate=3e-4, torque=2.0)


def course(steps: Mapping[float, float], law: Law) -> Path:
    """Return the way of a tool along x that takes these steps, by their times."""

    def along(t: Array) -> Array:
        way = np.zeros(len(t))
        for start, length in steps.items():
            response = second_order(length, law.damping, law.frequency)
            way += np.where(t >= start, response(np.maximum(t - start, 0.0)), 0.0)
        return way

    return line(along)


def goal(steps: Mapping[float, float]) -> Path:
    return line(lambda t: np.sum([length * (t >= start) for start, length in steps.items()], axis=0))


def run_of(law: Law) -> RunData:
    """Return the handover as it goes under a made-up controller."""
    run = make_run(
        end=law.end,
        tool={arm: course(steps, law) for arm, steps in STEPS.items()},
        target={arm: goal(steps) for arm, steps in STEPS.items()},
        events=[event for event in law.events if event.stamp_ns <= law.end * NS],
    )
    t = run.tick_ns / NS
    tools = {arm: np.array(rows) for arm, rows in run.tool_pose.items()}
    tools["arm_b"][:, 1] += law.offset
    tools["arm_b"][:, 3:] = turns(np.full(len(run.reference_ns), law.angle), (1.0, 0.0, 0.0))
    fading = np.where(t > 0.0, np.exp(TICK_NS / NS - t), 0.0)
    return changed(
        run,
        tool_pose=tools,
        base_pose=poses(line(lambda t: law.drift * t)(t), turns(law.turn_rate * t)),
        base_twist=np.tile([law.drift, 0, 0, 0, 0, law.turn_rate], (len(t), 1)),
        joint_effort=law.torque * np.outer(fading, np.ones(len(JOINTS))),
    )


def verdicts(nmpc: Law, pid: Law) -> dict[str, Claim]:
    return {claim.name: claim for claim in judge(measure(run_of(nmpc)), measure(run_of(pid)))}


def figures(claim: Claim) -> dict[str, tuple[float, float]]:
    return {finding.label: (finding.nmpc, finding.pid) for finding in claim.findings}


def test_every_claim_holds_for_a_good_and_a_bad_controller() -> None:
    found = verdicts(GOOD, BAD)
    assert list(found) == ["completion", "overshoot", "settling", "drift", "peak_torque", "final_error"]
    assert [name for name, claim in found.items() if not claim.holds] == []


def test_the_order_in_which_arms_are_listed_decides_nothing() -> None:
    runs = [changed(run_of(law), arms=("arm_b", "arm_a")) for law in (GOOD, BAD)]
    found = judge(*map(measure, runs))
    assert [claim.name for claim in found if not claim.holds] == []


def test_claims_are_about_who_is_who() -> None:
    swapped = verdicts(BAD, GOOD)
    assert [swapped[name].holds for name in ("overshoot", "settling", "drift")] == [False] * 3


def test_equal_controllers_bear_out_no_difference() -> None:
    same = verdicts(GOOD, GOOD)
    assert [same[name].holds for name in ("overshoot", "settling", "drift")] == [False] * 3
    assert same["completion"].holds


@pytest.mark.parametrize("which", ["nmpc", "pid"])
@pytest.mark.parametrize(
    "flaw",
    [
        Law(events=()),
        Law(events=(grasp(20.02), HANDOVER[1])),
        Law(events=(HANDOVER[0], replace(HANDOVER[1], stamp_ns=41 * NS))),
        Law(events=(HANDOVER[0], replace(HANDOVER[1], status=GraspStatus.MISSED))),
        Law(events=(replace(HANDOVER[0], status=GraspStatus.MISSED), HANDOVER[1])),
        Law(events=(*HANDOVER, grasp(50.0, GraspAction.RELEASE, "arm_b"))),
        Law(events=(grasp(20.0, arm="arm_b"),)),
        Law(offset=0.009),
        Law(angle=0.036),
        Law(end=30.0),
        Law(end=40.5),
    ],
    ids=[
        "no grasp",
        "late",
        "late pass",
        "miss",
        "miss of A",
        "let go",
        "only B",
        "off",
        "turned",
        "30 s",
        "40 s",
    ],
)
def test_a_handover_that_is_not_complete_is_said_to_be_so(flaw: Law, which: str) -> None:
    good = {"nmpc": GOOD, "pid": BAD}
    broken = replace(good[which], **{n: getattr(flaw, n) for n in ("events", "offset", "angle", "end")})
    found = verdicts(**{**good, which: broken})
    assert not found["completion"].holds


def test_a_release_and_a_grasp_pass_the_deputy_on_as_well() -> None:
    events = (grasp(20.0), grasp(40.0, GraspAction.RELEASE), grasp(40.02, arm="arm_b"))
    assert verdicts(replace(GOOD, events=events), BAD)["completion"].holds


def test_overshoot_and_settling_are_those_of_every_motion() -> None:
    found = verdicts(GOOD, BAD)
    motions = ["approach, arm_a", "carry, arm_a", "carry, arm_b", "withdraw, arm_b"]
    assert list(figures(found["overshoot"])) == list(figures(found["settling"])) == motions
    ratio = np.exp(-np.pi * 0.3 / np.sqrt(1.0 - 0.09))
    assert figures(found["overshoot"])["carry, arm_b"][1] == pytest.approx(250.0 * ratio, rel=1e-3)


def test_one_motion_that_goes_the_other_way_refutes_a_claim() -> None:
    nmpc, pid = run_of(GOOD), run_of(BAD)
    better = {**pid.tool_pose, "arm_b": run_of(replace(GOOD, damping=0.9)).tool_pose["arm_b"]}
    found = {c.name: c for c in judge(measure(nmpc), measure(changed(pid, tool_pose=better)))}
    assert not found["overshoot"].holds


def test_never_settling_is_later_than_settling() -> None:
    found = verdicts(GOOD, replace(BAD, offset=0.02))["settling"]
    assert isnan(figures(found)["carry, arm_b"][1])
    assert found.holds
    assert not verdicts(replace(GOOD, offset=0.02), BAD)["settling"].holds


def test_drift_is_compared_over_the_window_of_the_slower_law() -> None:
    found = figures(verdicts(GOOD, BAD)["drift"])
    slow = {item.phase.name: item.settling_time for item in measure(run_of(BAD)).phases}
    for name in ("approach", "carry", "withdraw"):
        assert found[f"{name}: settled after"] == (slow[name], slow[name])
    assert found["position, all windows together"] == pytest.approx((0.1, 50.0))
    assert found["attitude, all windows together"] == pytest.approx((1.0, 300.0))
    assert found["attitude, last 25% of the phases"] == pytest.approx((1.0, 300.0))


def test_a_drift_that_fades_away_is_gone_in_the_last_quarter() -> None:
    pid = run_of(BAD)
    fading = 1e-3 * np.exp(-(pid.tick_ns / NS) / 0.5)  # all of it early in the first phase
    pid = changed(pid, base_pose=poses(line(lambda t: fading)(fading)))
    found = figures({claim.name: claim for claim in judge(measure(run_of(GOOD)), measure(pid))}["drift"])
    assert found["position, last 25% of the phases"][1] < 1e-3 * found["position, approach, since then"][1]


@pytest.mark.parametrize(
    ("drift", "turn_rate", "holds"),
    [(1.01e-6, 1.01e-5, True), (0.99e-6, 1.01e-5, False), (1.01e-6, 0.99e-5, False)],
)
def test_drift_must_be_ten_times_as_fast_in_position_and_in_attitude(
    drift: float, turn_rate: float, holds: bool
) -> None:
    assert verdicts(GOOD, replace(BAD, drift=drift, turn_rate=turn_rate))["drift"].holds is holds


def test_drift_cannot_be_compared_where_a_law_never_settles() -> None:
    found = verdicts(GOOD, replace(BAD, offset=0.02))["drift"]
    assert not found.holds
    assert np.isnan(figures(found)["position, all windows together"]).all()


def test_no_drift_at_all_is_less_than_any() -> None:
    still = replace(GOOD, drift=0.0, turn_rate=0.0)
    assert verdicts(still, BAD)["drift"].holds
    assert not verdicts(still, replace(BAD, drift=0.0, turn_rate=0.0))["drift"].holds


@pytest.mark.parametrize(("torque", "holds"), [(1.19, False), (1.21, True), (2.59, True), (2.61, False)])
def test_peak_torque_is_about_two_newton_metres(torque: float, holds: bool) -> None:
    assert verdicts(replace(GOOD, torque=torque), BAD)["peak_torque"].holds is holds
    assert verdicts(GOOD, replace(BAD, torque=torque))["peak_torque"].holds is holds


def test_the_final_error_is_judged_under_nmpc_only() -> None:
    assert verdicts(GOOD, replace(BAD, offset=0.002))["final_error"].holds
    assert verdicts(replace(GOOD, offset=0.0009), BAD)["final_error"].holds
    found = verdicts(replace(GOOD, offset=0.0011), BAD)["final_error"]
    assert not found.holds
    assert found.findings[0].nmpc == pytest.approx(1.1)


def test_runs_without_phases_or_with_one_arm_get_verdicts_too() -> None:
    empty = measure(make_run(phases=(("late", 100.0),)))
    assert not any(claim.holds for claim in judge(empty, empty))
    run = run_of(GOOD)
    one = changed(run, arms=run.arms[:1], tool_pose={"arm_a": run.tool_pose["arm_a"]})
    assert not judge(measure(one), measure(one))[0].holds


def apart(least: float, allowed: float = 0.0) -> GroupClearance:
    return GroupClearance(
        "gripper arm_a - deputy", least, allowed, 21_770_000_000, ("arm_a_gripper", "deputy")
    )


def bodies(run: RunMetrics, *groups: GroupClearance) -> RunMetrics:
    """Return a run of which it is known how near these bodies came."""
    return replace(run, clearance=RunClearance(groups))


@pytest.mark.parametrize(
    ("group", "holds"),
    [
        (apart(0.001), True),
        (apart(-1e-6), False),
        (apart(-0.0009, allowed=-0.001), True),
        (apart(-0.0011, allowed=-0.001), False),
    ],
)
@pytest.mark.parametrize("which", [0, 1])
def test_a_handover_is_complete_only_if_nothing_passes_through_anything(
    group: GroupClearance, holds: bool, which: int
) -> None:
    laws = [bodies(measure(run_of(law)), apart(0.02)) for law in (GOOD, BAD)]
    laws[which] = bodies(laws[which], apart(0.02), group)
    claim = judge(*laws)[0]
    assert claim.holds is holds
    assert figures(claim)["collisions"][which] == float(not holds)
    assert figures(claim)["least clearance beyond what is allowed"][which] == pytest.approx(
        1000.0 * group.margin
    )
    assert [note.partition(":")[0] for note in claim.notes] == ([] if holds else [("NMPC", "PID")[which]])


def test_a_collision_is_named_wherever_a_run_is_called_complete_or_not() -> None:
    """Bodies, time and depth: in the table, in the note of the claim and in the summary for JSON."""
    runs = {"first": run_of(GOOD), "second": run_of(BAD), "third": run_of(GOOD)}
    found = compare(runs, laws={"first": "nmpc", "second": "pid", "third": "task_space_pd"})
    measured = dict(found.runs)
    for name, groups in {"first": (apart(0.1),), "second": (apart(-0.06),)}.items():
        measured[name] = bodies(measured[name], *groups)
    claims = judge(measured["first"], measured["second"])
    found = replace(found, runs=measured, claims=claims)
    words = "arm_a_gripper and deputy 60.00 mm in each other at 21.77 s"
    assert claims[0].notes == (f"PID: {words}",) and len(found.claims) == 6
    lines = render(found).splitlines()
    complete = [cell for line in lines if line.startswith("complete") for cell in line.split()[1:]]
    assert complete == ["yes", "no", "yes"]
    assert {f"  second: {words}", f"  PID: {words}", "  third: clearance unknown"} <= {*lines}
    made = summary(found)["runs"]
    assert [made[name]["completion"]["complete"] for name in made] == [True, False, True]
    assert made["second"]["completion"]["shortfalls"] == [words]
    assert [made[name]["completion"]["clearance_known"] for name in made] == [True, True, False]


def test_a_task_that_was_not_done_says_what_it_lacks() -> None:
    missed = grasp(20.0, status=GraspStatus.MISSED)
    run = run_of(replace(GOOD, events=(missed,), end=30.0))
    expected = tuple(replace(phase, end_ns=60 * NS) for phase in run.phases)
    failed = (*expected[:-1], replace(expected[-1], state=PhaseState.FAILED))
    lacking = ("20 s: arm_a takes end: missed", "ended at 30 s, the task ends at 60 s")
    assert completion(changed(run, phases=expected), None).shortfalls == lacking
    assert "phase carry failed at 30 s" in completion(changed(run, phases=failed), None).shortfalls
    assert completion(changed(run, phases=()), None).shortfalls == ("no phase of a task was recorded",)
    assert completion(run_of(GOOD), None).complete
