"""Inputs that stop coming, targets out of reach and grasps that miss: what the watchdogs promise."""

import os
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import yaml

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.topics import CONTROLLER, IK, PLANT, TRAJECTORY
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus
from sms_handover.units import NS_PER_S

from ..ros.short_handover import short_handover
from ..system.runs import Ended, Running
from .fault import Fault
from .outcome import Kept, require
from .promises import closed, exit_code
from .trial import Trial

TITLE = "Inputs that stop coming, grasps that miss"

_HOLD = 0.06  # [s] simulated time that a failed phase is held
_MISSES_IN = "colliding"  # the scenario of grasps that miss: towards a step target an arm starts slowly
_FAR_OFF = (0.1, 0.0, 0.0)  # [m] of the deputy: ten times what a grasp allows, on a busy machine too
_TIMEOUT = 3.0  # [s] wall time without an answer that a run in lock step endures here
_SLOW = ("-p", "common.tick:=0.005", "-p", "common.reference_period:=0.02")  # for a busy machine

Kinds = Sequence[str]


@dataclass(frozen=True)
class Task:
    """A run and what it is made of."""

    ended: Ended
    schedule: Path


# Grasps and targets


def carry_out(on_miss: object, options: Sequence[object], trial: Trial, *, stretch: float = 1.0) -> Task:
    """Run a short handover whose first grasp misses, with a policy."""
    schedule = yaml.safe_load(short_handover(stretch=stretch, deputy_off=_FAR_OFF))
    schedule["phases"][1]["on_miss"] = on_miss
    return task_of(schedule, (_MISSES_IN, *options), trial)


def task_of(schedule: object, options: Sequence[object], trial: Trial) -> Task:
    """Run a schedule to its end."""
    path = trial.folder / "schedule.yaml"
    path.write_text(yaml.safe_dump(schedule, sort_keys=False), encoding="utf-8")
    hold = ("-p", f"trajectory.failure_hold:={_HOLD}")
    return Task(trial.sms_handover("run", *options, "--schedule", path, *hold, "-o", "run"), path)


def decisions(trial: Trial) -> tuple[RunData, list[str]]:
    """Return the recorded run, and the kinds of events in it."""
    run = read_run(trial.folder / "run" / "bag")
    return run, [event.kind for event in run.run_events]


def decided(code: int, kinds: Kinds, trial: Trial, task: Task) -> Kept:
    """Require an exit code, exactly these events in the bag, and the run of ``simulate`` bit for bit."""
    exit_code(task.ended, code)
    run, found = decisions(trial)
    require(found == list(kinds), f"the events are {found}, expected {list(kinds)}")
    missing = [kind for kind in kinds if kind not in task.ended.err]
    require(not missing, f"the launcher has not told of {missing}")
    values = {"common": {"schedule": str(task.schedule)}, TRAJECTORY: {"failure_hold": _HOLD}}
    alone = simulate(load_scenario(_MISSES_IN, values))
    differences = compare_runs(run, alone)
    require(not differences, f"not as in one process: {', '.join(map(str, differences))[:200]}")
    return closed(trial.folder / "run" / "bag", task.ended)


def decided_in_real_time(first: str, trial: Trial, task: Task) -> Kept:
    """Require the decision that the policy asks for at the first miss, and an exit code as the grasps ended.

    When the machine is busy the arms are elsewhere than in lock step, so a retry may succeed or not.
    """
    run, _ = decisions(trial)
    found = [event.kind for event in run.run_events if event.node == TRAJECTORY]
    require(found[:1] == [first], f"the events of the task are {found}, expected {first} first")
    last = {event.command: event.status for event in run.grasp_events}
    exit_code(task.ended, 0 if set(last.values()) == {GraspStatus.SUCCEEDED} else 4)
    return closed(trial.folder / "run" / "bag", task.ended)


def unsolved(trial: Trial) -> Task:
    """Let inverse kinematics give up after one iteration, twice in a row."""
    schedule = yaml.safe_load(short_handover())
    options = ("-p", "ik.max_iterations:=1", "-p", "trajectory.ik_failures:=2")
    return task_of(schedule, options, trial)


def failed_by_ik(trial: Trial, task: Task) -> Kept:
    """Require a failed task, and joints that are held from then on."""
    exit_code(task.ended, 1)
    run, found = decisions(trial)
    require(found[-1] == "ik_failed", f"the events are {found}")
    event = run.run_events[-1]
    held = run.reference_position[run.reference_ns >= event.stamp_ns]
    require(bool(np.all(held == held[0])), "the reference moves after the phase has failed")
    require(int(run.tick_ns[-1]) == event.stamp_ns + round(_HOLD * NS_PER_S), "the run does not end in time")
    return closed(trial.folder / "run" / "bag", task.ended)


def refused_policy(policy: object, trial: Trial) -> Ended:
    """Give a policy that makes no sense."""
    schedule = yaml.safe_load(short_handover())
    schedule["phases"][1]["on_miss"] = policy
    return task_of(schedule, (), trial).ended


def refused_in_words(words: str, trial: Trial, ended: Ended) -> Kept:
    """Require exit code 2, and one line that has some words."""
    exit_code(ended, 2)
    require(len(ended.errors) == 1 and words in ended.errors[0], f"it says {ended.err[-200:]!r}")
    return Kept(ended.code)


# Inputs that stop coming


def stop_and_go_on(node: str, options: Sequence[object], trial: Trial) -> Ended:
    """Stop a node in a run for a while of simulated time, let it go on, and end the run when it is over."""
    with trial.start("run", *options, "-p", "common.duration:=4.0", "-o", "run") as run:
        run.until_recorded(trial.folder / "run" / "bag", 100_000)
        os.kill(run.nodes[node], signal.SIGSTOP)
        try:
            run.until(lambda: said(run, node), "the watchdog")
        finally:
            os.kill(run.nodes[node], signal.SIGCONT)
        return trial.ended(run)


def said(run: Running, node: str) -> bool:
    """Whether the watchdog for a stopped node has told the last that it tells."""
    return ("torque_zero" if node == CONTROLLER else "reference_lost") in run.text


def stop_for_good(node: str, trial: Trial) -> Ended:
    """Stop a node of a run in lock step and never let it go on."""
    timeout = ("-p", f"plant.answer_timeout:={_TIMEOUT}")
    with trial.start("run", *timeout, "-o", "run") as run:
        run.until_recorded(trial.folder / "run" / "bag", trial.random.randint(100_000, 400_000))
        os.kill(run.nodes[node], signal.SIGSTOP)
        run.until(lambda: "no_answer" in run.text, "the watchdog")
        os.kill(run.nodes[node], signal.SIGCONT)  # or it could not tell how much it has published
        return trial.ended(run)


def ended_without_answer(trial: Trial, ended: Ended) -> Kept:
    """Require a run that has failed, says on what nothing came, and a bag with all of it."""
    exit_code(ended, 1)
    _, found = decisions(trial)
    require("no_answer" in found, f"the events are {found}")
    require("nothing has come on" in ended.out, "the launcher does not say what was missing")
    return closed(trial.folder / "run" / "bag", ended)


def went_on(kinds: Kinds, trial: Trial, ended: Ended) -> Kept:
    """Require a run to its end with these events in this order, among others."""
    exit_code(ended, 0)
    run, found = decisions(trial)
    rest = iter(found)
    require(all(kind in rest for kind in kinds), f"the events are {found}, expected {list(kinds)} in order")
    require(bool(np.all(np.isfinite(run.joint_position))), "the states are not finite")
    return closed(trial.folder / "run" / "bag", ended)


def torque_was_zero(trial: Trial, ended: Ended) -> Kept:
    """Require besides that the torque fell to zero without ever growing, and came back."""
    kept = went_on(("command_lost", "torque_zero", "command_back"), trial, ended)
    run, _ = decisions(trial)
    zero = next(event.stamp_ns for event in run.run_events if event.kind == "torque_zero")
    lost = max(e.stamp_ns for e in run.run_events if e.kind == "command_lost" and e.stamp_ns < zero)
    of_plant = [e.stamp_ns for e in run.run_events if e.node == PLANT]
    back = min(
        stamp for stamp in of_plant if stamp > zero
    )  # late commands may come first, ramped by their age
    ramp = (run.tick_ns > lost) & (run.tick_ns <= zero)
    grows = np.diff(np.abs(run.joint_effort[ramp]), axis=0).max(initial=0.0)
    require(grows <= 0.0, f"the torque grows by {grows:g} N m in the ramp")
    off = (run.tick_ns > zero) & (run.tick_ns <= back)
    require(not np.any(run.joint_effort[off]), "there is a torque after the ramp")
    return kept


_MISSES: tuple[tuple[str, object, Kinds], ...] = (
    ("miss-continue", "continue", ("grasp_missed", "grasp_missed")),
    ("miss-abort", "abort", ("grasp_failed",)),
    ("miss-retry-once", {"retry": 1}, ("phase_retried", "grasp_failed")),
    ("miss-retry-thrice", {"retry": 3}, ("phase_retried",) * 3 + ("grasp_failed",)),
)

FAULTS: tuple[Fault[Task] | Fault[Ended], ...] = (
    *(
        Fault(
            name=name,
            injected=f"a first grasp that misses, on_miss: {policy}",
            promise=f"exit code 4; {', '.join(dict.fromkeys(kinds))}; the run of simulate bit for bit",
            inject=partial(carry_out, policy, ()),
            check=partial(decided, 4, kinds),
        )
        for name, policy, kinds in _MISSES
    ),
    *(
        Fault(
            name=f"{name}-in-real-time",
            injected=f"a first grasp that misses in real time, on_miss: {policy}",
            promise=f"{kinds[0]} at the first miss; exit code 4 unless a retry succeeds; the bag is closed",
            inject=partial(carry_out, policy, ("--real-time", *_SLOW), stretch=4.0),
            check=partial(decided_in_real_time, kinds[0]),
        )
        for name, policy, kinds in _MISSES
    ),
    Fault(
        name="ik-does-not-converge",
        injected="inverse kinematics that gives up after one iteration",
        promise="after ik_failures solves the joints are held and the run ends with 1 when it says",
        inject=unsolved,
        check=failed_by_ik,
    ),
    Fault(
        name="policy-unknown",
        injected="on_miss: abbort",
        promise="refused with 2 and the word meant",
        inject=partial(refused_policy, "abbort"),
        check=partial(refused_in_words, "'abort'"),
    ),
    Fault(
        name="policy-without-count",
        injected="on_miss: retry, without how often",
        promise="refused with 2 and how to write it",
        inject=partial(refused_policy, "retry"),
        check=partial(refused_in_words, "{retry: 2}"),
    ),
    *(
        Fault(
            name=f"{node}-stopped-in-lock-step",
            injected=f"SIGSTOP of the {node} at a random moment of a run in lock step",
            promise="after answer_timeout the run ends with 1 and names what did not come; the bag is closed",
            inject=partial(stop_for_good, node),
            check=ended_without_answer,
            seeded=True,
        )
        for node in (CONTROLLER, TRAJECTORY, IK)
    ),
    Fault(
        name="controller-stopped-in-real-time",
        injected="SIGSTOP of the controller in real time until the torque is zero, then SIGCONT",
        promise="the torque is held, ramped to zero and comes back; three events; the run goes on to its end",
        inject=partial(stop_and_go_on, CONTROLLER, ("--real-time", *_SLOW)),
        check=torque_was_zero,
    ),
    *(
        Fault(
            name=f"{node}-stopped-in-real-time",
            injected=f"SIGSTOP of the {node} in real time until references are missed, then SIGCONT",
            promise="the desired joints stand still; two events; the run goes on to its end",
            inject=partial(stop_and_go_on, node, ("--real-time", *_SLOW)),
            check=partial(went_on, ("reference_lost", "reference_back")),
        )
        for node in (TRAJECTORY, IK)
    ),
)
