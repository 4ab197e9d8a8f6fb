"""Quiet periods: many reference periods in one call give the bits of one period after the other."""

import gc
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sms_handover.compiled.c_function import CFunction, NativeFunction
from sms_handover.compiled.effects import CompiledResistedStepper
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.conditions.joint_values import FrictionValues
from sms_handover.control.controller import JointController
from sms_handover.control.nmpc import NmpcLaw
from sms_handover.control.protocol import Guidance
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.run_data import RunData
from sms_handover.simulation import loop as loop_module
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.period_runner import PeriodRunner, PythonRunner
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.simulation.recorder import RunRecorder
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import plain
from sms_handover.simulation.wiring import make_controller, make_plant, make_runner, say_once
from sms_handover.types import GraspStatus, JointReference, TaskPhase

from ..ros.short_handover import short_handover
from .conftest import SCHEDULE, Draw
from .retried_handover import LAWS, retried_handover
from .test_conditions import EFFECTS, ROTOR

COMPILED: Overrides = {"common": {"dynamics": "compiled"}}
UNLIKE: dict[str, Any] = {"deputy.mass": 2.0, "model.deputy.mass": 2.2}  # [kg]
_PERIOD = 20  # ticks

pytestmark = pytest.mark.usefixtures("kept_libraries")


def python_loop(scenario: Scenario) -> Loop:
    """Return a loop whose ticks and periods are carried out by Python."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            loop_module, "make_runner", lambda plant, controller, *_: PythonRunner(plant, controller)
        )
        return Loop(scenario)


def runner_of(scenario: Scenario) -> PeriodRunner:
    """Return what carries out the ticks of a scenario, for a reference at rest."""
    common, known = scenario.parameters.common, scenario.model
    plant = make_plant(scenario.truth.robot, scenario.truth.schedule, common, scenario.parameters.plant)
    controller = make_controller(known.robot, known.schedule, common, scenario.parameters.controller)
    rest = JointReference(0, plant.state.joint_position, plant.state.joint_velocity)
    controller.guide(Guidance(TaskPhase(0, 0, ""), rest, {}))
    return make_runner(plant, controller, known.robot, common, scenario.parameters.plant)


def rest_of(loop: Loop) -> tuple[RunData, int]:
    """Return the rest of a run, and in how many calls it was carried out."""
    robot = loop.scenario.model.robot
    recorder, calls = RunRecorder(robot.joint_names, robot.arms, 100), 0  # ticks, of which there are more
    while not loop.finished:
        recorder.add(loop.advance_quietly(recorder.room))
        calls += 1
    return recorder.data(loop.base_wrenches, loop.applied), calls


def require_same(one: RunData, other: RunData) -> None:
    """Require the same bits in every array, and the same events."""
    for name, value in vars(one).items():
        theirs = getattr(other, name)
        if isinstance(value, dict):
            assert all(rows.tobytes() == theirs[arm].tobytes() for arm, rows in value.items()), name
        elif isinstance(value, np.ndarray):
            assert (value.dtype, value.shape) == (theirs.dtype, theirs.shape), name
            assert np.array_equal(value, theirs, equal_nan=True), name
            assert np.array_equal(np.signbit(value), np.signbit(theirs)) or np.isnan(value).any(), name
        else:
            assert repr(value) == repr(theirs), name


def close_handover(folder: Path, *, follows: bool) -> dict[str, Any]:
    """Return the values of a handover whose grasps all succeed, as everything is near its place at first.

    The second arm ``follows`` its end of the deputy while the first one carries it, or goes to a pose.
    """
    schedule = folder / "close.yaml"
    text = yaml.safe_load(short_handover(stretch=4.0))
    if follows:
        text["phases"][1]["arms"]["arm_b"] = {"grasp_frame": "end_b"}
    schedule.write_text(yaml.safe_dump(text, sort_keys=False), encoding="utf-8")
    return {"common": {"schedule": str(schedule)}}


def merged(*parts: dict[str, Any] | Overrides) -> Overrides:
    """Return the values of several."""
    values: dict[str, Any] = {}
    for part in parts:
        for name, section in part.items():
            values[name] = {**values.get(name, {}), **section} if isinstance(section, dict) else section
    return values


@pytest.mark.parametrize("time_law", ["step", "quintic"])
@pytest.mark.parametrize("law", LAWS)
def test_a_task_is_that_of_python(law: str, time_law: str, tmp_path: Path) -> None:
    """With a grasp that misses and is tried again; the joints of arm A turn faster than they may."""
    fast = {"robot": {"arms.arm_a.limits": {"joint_6": {"velocity": 0.002}}}}
    values = merged(
        retried_handover(tmp_path),
        COMPILED,
        {"controller": LAWS[law], "trajectory": {"time_law": time_law}},
        fast,
    )
    scenario = load_scenario(values=values)
    theirs = python_loop(scenario)
    expected, calls = rest_of(theirs)
    quiet = Loop(scenario)
    found, fewer = rest_of(quiet)
    require_same(found, expected)
    assert plain(quiet.snapshot()) == plain(theirs.snapshot())
    assert any(event.kind == "rate_exceeded" for event in found.run_events)
    assert found.grasp_events[0].status is not GraspStatus.REJECTED
    assert calls == len(found.reference_ns) and fewer < calls - 5
    reference = simulate(load_scenario(values=merged(values, {"common": {"dynamics": "pinocchio"}})))
    assert np.abs(found.joint_position - reference.joint_position).max() < 1e-9
    assert repr(found.grasp_events)[:40] == repr(reference.grasp_events)[:40]


def test_a_snapshot_of_one_goes_on_in_the_other(tmp_path: Path) -> None:
    scenario = load_scenario(
        values=merged(retried_handover(tmp_path), COMPILED, {"trajectory": {"time_law": "step"}})
    )
    ours, theirs = Loop(scenario), python_loop(scenario)
    for _ in range(5):
        ours.advance_quietly()
    while theirs.state.stamp_ns < ours.state.stamp_ns:
        theirs.advance_period()
    one, other = ours.snapshot(), theirs.snapshot()
    assert plain(one) == plain(other)
    ours.restore(other)
    theirs.restore(one)
    require_same(rest_of(ours)[0], rest_of(theirs)[0])


@pytest.mark.parametrize("most", [0, 3])
def test_targets_out_of_reach_fail_at_the_same_tick(most: int, tmp_path: Path) -> None:
    far = tmp_path / "far.yaml"
    far.write_text(SCHEDULE.replace("xyz: [1.25, 0.0, 0.75]", "xyz: [9.25, 0.0, 0.75]"), encoding="utf-8")
    ending = {"time_law": "step", "ik_failures": most, "failure_hold": 0.2}
    common = {"common": {"schedule": str(far), "duration": 1.0}}
    scenario = load_scenario(values=merged(common, COMPILED, {"trajectory": ending}))
    found, calls = rest_of(Loop(scenario))
    expected, _ = rest_of(python_loop(scenario))
    require_same(found, expected)
    assert ("ik_failed" in [event.kind for event in found.run_events]) == (most > 0)
    assert calls < len(found.reference_ns) / 2


def test_what_is_no_number_stays_none(tmp_path: Path) -> None:
    """From a state with a rate that is no number, of which all of the rest becomes none."""
    scenario = load_scenario(
        values=merged(retried_handover(tmp_path), COMPILED, {"trajectory": {"time_law": "step"}})
    )
    runs = []
    for loop in (Loop(scenario), python_loop(scenario)):
        for _ in range(3):
            loop.advance_period()
        state = plain(loop.snapshot())
        assert state["plant"]["tick"] == 3 * _PERIOD
        snapshot = loop.snapshot()
        v = np.array(snapshot.plant.v)
        v[-1] = np.nan
        object.__setattr__(snapshot.plant, "v", v)
        loop.restore(snapshot)
        ticks = [loop.advance_quietly() for _ in range(2)]
        runs.append(ticks)
    ours, theirs = runs
    assert isinstance(ours[0], QuietPeriods)
    assert np.isnan(ours[0].rows.q).any()
    for name in ("q", "v", "effort", "joint_effort"):
        found, expected = (getattr(run[0].rows, name)[:_PERIOD] for run in (ours, theirs))
        assert np.array_equal(found, expected, equal_nan=True), name


@pytest.mark.parametrize("odd", [np.nan, np.inf])
@pytest.mark.parametrize("law", LAWS)
def test_a_law_that_gives_no_number(law: str, odd: float, tmp_path: Path) -> None:
    """From a gain or a memory that is none, or infinite: the same efforts, states and events to the end."""
    values = {"controller": LAWS[law], "trajectory": {"time_law": "step", "ik_failures": 3}}
    scenario = load_scenario(values=merged(retried_handover(tmp_path), COMPILED, values))
    runs = []
    for loop in (Loop(scenario), python_loop(scenario)):
        for _ in range(3):
            loop.advance_period()
        assert isinstance(loop._controller, JointController)
        inner = loop._controller.law
        if isinstance(inner, NmpcLaw):
            inner.feedback[0] = odd
        else:
            inner.restore(np.full(scenario.model.robot.n_joints, odd))
        runs.append((*rest_of(loop), loop.last_tick))
    (found, fewer, last), (expected, calls, theirs) = runs
    require_same(found, expected)
    assert last == theirs and fewer < calls
    assert np.isnan(found.joint_command).any()


@pytest.mark.parametrize(
    ("deputy", "follows"), [({}, True), ({"deputy.mass": 2.0}, False), (UNLIKE, False)], ids=str
)
@pytest.mark.parametrize("law", LAWS)
def test_a_deputy_changes_hands(law: str, deputy: dict[str, Any], follows: bool, tmp_path: Path) -> None:
    """It is grasped as it rests, carried, handed over; its mass counts by parameters that are passed on.

    The law knows of it, by another mass too, and takes it to lie in the hand exactly.
    """
    values = merged(
        close_handover(tmp_path, follows=follows),
        {"common": {"duration": 1.5, "on_touch": "report"}, "controller": LAWS[law], **deputy},
        {"trajectory": {"time_law": "quintic"}},
    )
    scenario = load_scenario(values=merged(values, COMPILED))
    theirs, ours = python_loop(scenario), Loop(scenario)
    expected, calls = rest_of(theirs)
    found, fewer = rest_of(ours)
    require_same(found, expected)
    assert plain(ours.snapshot()) == plain(theirs.snapshot())
    assert [event.status for event in found.grasp_events] == [GraspStatus.SUCCEEDED] * 2
    assert (found.lost[-1] > 0.0) == bool(deputy)
    assert fewer < (calls / 2 if deputy else calls / 4)  # the way to a deputy with mass is Python's
    reference = simulate(load_scenario(values=values))
    assert np.abs(found.joint_position - reference.joint_position).max() < 1e-9


# Those of sensors are left to Python.
IN_C = {name: values for name, values in EFFECTS.items() if not name.startswith("sensors")}
EVERYTHING = {path: value for values in IN_C.values() for path, value in values.items()}


def conditioned(effects: dict[str, Any], dynamics: str, **more: Any) -> Scenario:
    """Return a short run under some effects, towards step targets."""
    values = {f"conditions.{path}": value for path, value in {**ROTOR, **effects}.items()}
    return load_scenario("colliding", {"common.duration": 0.1, "common.dynamics": dynamics, **values, **more})


@pytest.mark.parametrize("effect", IN_C)
def test_an_effect_acts_in_c_as_by_pinocchio(effect: str) -> None:
    loop = Loop(conditioned(IN_C[effect], "compiled"))
    assert isinstance(loop._runner, CompiledTicks)
    found, calls = rest_of(loop)
    assert calls <= 3
    expected, ideal = (simulate(conditioned(effects, "pinocchio")) for effects in (IN_C[effect], {}))
    acting = np.abs(expected.joint_velocity - ideal.joint_velocity).max()
    assert acting > 1e-11
    assert np.abs(found.joint_velocity - expected.joint_velocity).max() < 0.01 * acting
    for name in ("joint_position", "joint_velocity", "joint_effort", "base_pose"):
        assert np.abs(getattr(found, name) - getattr(expected, name)).max() < 1e-11, name
    for name in ("lost", "work", "external_work", "linear_impulse", "angular_impulse"):
        size = np.abs(getattr(expected, name)).max()
        assert np.abs(getattr(found, name) - getattr(expected, name)).max() <= 1e-11 * size, name


@pytest.mark.parametrize("law", LAWS)
def test_ticks_under_conditions_are_those_of_python(law: str) -> None:
    """Whatever the calls in which they are carried out, and again after a snapshot and a reset."""
    scenario = conditioned(EVERYTHING, "compiled", law=law)
    ours, theirs = Loop(scenario), python_loop(scenario)
    expected, _ = rest_of(theirs)
    found, _ = rest_of(ours)
    require_same(found, expected)
    assert plain(ours.snapshot()) == plain(theirs.snapshot())
    ours.reset()
    ours.advance_quietly()
    ours.advance_period()
    theirs.restore(ours.snapshot())
    require_same(rest_of(ours)[0], rest_of(theirs)[0])
    ours.reset()
    require_same(rest_of(ours)[0], expected)


def test_joints_stick_in_c_as_by_python() -> None:
    """With friction that brings joints to rest, one after the other, and lets some break away."""
    robot, tick_ns = conditioned({}, "compiled").truth.robot, 1_000_000
    count, h = robot.n_joints, 1e-3
    values = FrictionValues(*(np.full(count, x) for x in (0.3, 0.2, 0.3, 0.01)))
    resistance, tableau = Resistance(JointFriction(values, h), ()), TABLEAUS["rk4"]
    python = ConditionedStepper(robot, resistance, PinocchioStepper(robot, tableau, h), tableau, h)
    steppers = python, CompiledResistedStepper(robot, resistance, tableau, tick_ns)
    draw = Draw(robot, 6)
    start = robot.configuration(draw.pose(), draw.joints()), draw.v(0.01)
    states, resting = [start, start], 0
    for k in range(300):
        effort = 0.35 * np.sin(0.02 * k + np.arange(count))
        states = [stepper.step(*state, effort) for stepper, state in zip(steppers, states, strict=True)]
        resting += int(np.count_nonzero(np.abs(states[0][1][6:]) < 1e-9))
        for ours, one in zip(states[1], states[0], strict=True):
            assert np.abs(ours - one).max() < 1e-11
        assert steppers[1].lost == pytest.approx(python.lost, abs=1e-12)
    assert 50 < resting < 300 * count - 50


def test_what_c_does_not_have_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    """One line for all loops of a process, which names what is not there."""
    say_once.cache_clear()
    values = {"plant.joint_limits": "enforce", "common.dynamics": "compiled", "common.duration": 0.04}
    for _ in range(2):
        runner_of(load_scenario(values=values))
    lines = [line for line in caplog.messages if "carried out by Python" in line]
    assert lines == ["ticks are carried out by Python: C does not have enforced joint limits"]


@pytest.mark.parametrize("time_law", ["step", "quintic"])
def test_the_work_of_a_quiet_phase(time_law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python takes part at its beginning and at its end alone, and there has few calls into C."""
    short = {"schedule.phases.approach.duration": 2.0, "schedule.phases.approach.motion": 1.0}
    values = {"common.dynamics": "compiled", "common.duration": 1.9, "trajectory.time_law": time_law, **short}
    loop = Loop(load_scenario(values=values))
    entered: Counter[str] = Counter()
    for kind in (NativeFunction, CFunction):

        def counted(self: Any, *arguments: Any, call: Any = kind.__call__, name: str = kind.__name__) -> Any:
            entered[name] += 1
            return call(self, *arguments)

        monkeypatch.setattr(kind, "__call__", counted)
    loop.advance_period()
    assert entered.total() <= 8, entered  # tools, momenta, goal, path, inverse kinematics, other arm, ticks
    entered.clear()
    _, calls = rest_of(loop)
    assert calls == 2  # the others, and the last state
    assert entered["NativeFunction"] <= 7, entered


def test_ticks_in_c_allocate_nothing() -> None:
    """As many blocks for two thousand ticks as for twenty."""
    run = runner_of(load_scenario(values={"common.dynamics": "compiled"}))
    blocks = []
    for ticks in (20, 20, 2000):
        gc.collect()
        before = sys.getallocatedblocks()
        rows = run.run(ticks, ticks)
        blocks.append(sys.getallocatedblocks() - before)
        assert len(rows) == ticks
    assert blocks[2] <= blocks[1] + 5


def test_a_deputy_that_drifts_after_a_release_moves_on() -> None:
    """C does not move it, so each period is Python's, and the run is the same."""
    scenario = load_scenario("planar", COMPILED)
    run, _ = rest_of(Loop(scenario))
    require_same(run, rest_of(python_loop(scenario))[0])
    assert run.grasp_events[-1].command.arm and np.ptp(run.deputy_pose[-100:, 0]) > 1e-6  # m in 2 s
