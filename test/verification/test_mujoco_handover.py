"""The whole handover under NMPC: ours against MuJoCo.

The joint efforts of the run, held over each tick, are replayed into MuJoCo and into our plant over
60 s. Nothing corrects either of them on the way, so every difference of the engines adds up.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from benchmarks.states import apart, order
from sms_handover.engines.mujoco_robot import MujocoRobot, State
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.reduced import base_twist_per_joint_rate, reduced_dynamics
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds
from test.evidence import Record, Table

_EPS = float(np.finfo(float).eps)
_ASKED = 1e-8  # [m, rad] agreement that is asked for
_REACH = 1.3  # [m] of an arm, gripper included
_ORDER_TOLERANCE = 0.1  # [-] what is asked of a measured order
_AGAINST = f"MuJoCo {mujoco.__version__}"

_TICK = 1_000_000  # [ns] of the run
_SAMPLE = 500_000_000  # [ns] between the states that are compared
_COARSE = 20_000_000  # [ns] over which efforts are averaged, to show the order: at 1 ms only rounding is left
_CASES = (  # efforts held over, step; both in ns
    *((_COARSE, _COARSE // division) for division in (1, 2, 4, 8)),
    (_TICK, _TICK),
    (_TICK, _TICK // 2),
)


@dataclass(frozen=True, eq=False)
class Replay:
    """The states of both engines each half second."""

    ours: list[State]
    mujoco: list[State]


def _efforts(run: RunData, hold: int) -> Array:
    """Return the efforts averaged over ``hold`` ns, a row each; the first of the run acted over no tick."""
    return np.asarray(run.joint_effort[1:].reshape(-1, hold // _TICK, len(run.joint_names)).mean(axis=1))


def _replay(start: State, efforts: Array, hold: int, apply: Callable[[Array], State]) -> list[State]:
    """Return the states every half second while efforts are applied one after another."""
    states = [start]
    for index, effort in enumerate(efforts, start=1):
        state = apply(effort)
        if index * hold % _SAMPLE == 0:
            states.append(state)
    return states


def _our_plant(scenario: Scenario, hold: int, step: int) -> Callable[[Array], State]:
    """Return what moves our plant by ``hold``, in ticks of ``step``, from the start of the schedule."""
    common = replace(scenario.parameters.common, tick=ns_to_seconds(step))
    plant = make_plant(scenario.truth.robot, scenario.truth.schedule, common, scenario.parameters.plant)

    def apply(effort: Array) -> State:
        for _ in range(hold // step):
            plant.apply(effort)
        state = plant.state
        return state.q, state.v

    return apply


def _in_mujoco(scenario: Scenario, start: State, hold: int, step: int) -> Callable[[Array], State]:
    """Return what moves MuJoCo's robot by ``hold`` in steps of ``step``, from the same start."""
    other = MujocoRobot.of(scenario.truth.robot.description)
    other.place(*start)

    def apply(effort: Array) -> State:
        other.drive(effort)
        other.advance(ns_to_seconds(step), hold // step)
        return other.state

    return apply


def _row(run: RunData, tick: int) -> State:
    """Return the recorded state of a tick."""
    q = np.concatenate([run.base_pose[tick], run.joint_position[tick]])
    return q, np.concatenate([run.base_twist[tick], run.joint_velocity[tick]])


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """The shipped scenario under NMPC."""
    return load_scenario("paper", {"controller": {"law": "nmpc"}})


@pytest.fixture(scope="module")
def run(scenario: Scenario) -> RunData:
    """The whole handover, with our plant in the loop."""
    return simulate(scenario)


@pytest.fixture(scope="module")
def replays(scenario: Scenario, run: RunData) -> dict[tuple[int, int], Replay]:
    """Both engines for every case."""
    start = _row(run, 0)
    found = {}
    for hold, step in _CASES:
        efforts = _efforts(run, hold)
        if (hold, step) == (_TICK, _TICK):  # our plant has done this already
            ours = [_row(run, tick) for tick in range(0, run.tick_ns.size, _SAMPLE // _TICK)]
        else:
            ours = _replay(start, efforts, hold, _our_plant(scenario, hold, step))
        others = _replay(start, efforts, hold, _in_mujoco(scenario, start, hold, step))
        found[hold, step] = Replay(ours, others)
    return found


Replays = dict[tuple[int, int], Replay]


def _furthest(a: list[State], b: list[State]) -> Array:
    """Return the largest difference of joints, base position and base angle over the run."""
    return np.asarray(np.max([apart(x, y) for x, y in zip(a, b, strict=True)], axis=0))


def _drift(scenario: Scenario, states: list[State]) -> tuple[float, float]:
    """Return the largest linear and angular momentum over the run, which starts at rest."""
    conserved = [conserved_quantities(scenario.truth.robot, *state) for state in states]
    linear = max(float(np.linalg.norm(each.linear_momentum)) for each in conserved)
    return linear, max(float(np.linalg.norm(each.angular_momentum)) for each in conserved)


def _rounding(scenario: Scenario, run: RunData) -> Array:
    """Return how far rounding can drive two engines apart in joints rad, base m and base rad.

    A solve with H* is exact to cond(H*) eps of the largest acceleration; were that error the same
    in every tick, it would be integrated twice over the run. Each engine errs so, and their errors may
    add. The base follows the joints by -H_b^-1 H_bm, as momentum demands.
    """
    states = [_row(run, tick) for tick in range(0, run.tick_ns.size, _SAMPLE // _TICK)]
    condition = max(
        np.linalg.cond(reduced_dynamics(scenario.truth.robot, *state).inertia) for state in states
    )
    tick_s, time_s = ns_to_seconds(_TICK), ns_to_seconds(int(run.tick_ns[-1]))
    acceleration = np.max(np.abs(np.diff(run.joint_velocity, axis=0))) / tick_s
    joints = 2.0 * condition * _EPS * acceleration * time_s**2 / 2.0
    reactions = np.array([base_twist_per_joint_rate(scenario.truth.robot, q) for q, _ in states])
    sums = np.abs(reactions).sum(axis=2).max(axis=0)
    return np.asarray(joints * np.array([1.0, np.linalg.norm(sums[:3]), np.linalg.norm(sums[3:])]))


def test_the_replay_is_the_run(scenario: Scenario, run: RunData) -> None:
    """Recorded efforts move our plant through the recorded states again, bit for bit."""
    efforts = _efforts(run, _TICK)[:1000]
    replayed = _replay(_row(run, 0), efforts, _TICK, _our_plant(scenario, _TICK, _TICK))
    for index, (q, v) in enumerate(replayed):
        recorded = _row(run, index * _SAMPLE // _TICK)
        np.testing.assert_array_equal(q, recorded[0])
        np.testing.assert_array_equal(v, recorded[1])


@pytest.mark.parametrize("step", [_TICK, _TICK // 2])
def test_joints_and_base_move_alike(
    scenario: Scenario, run: RunData, replays: Replays, record: Record, step: int
) -> None:
    """Over the whole run, at the step of the plant and at half of it."""
    replay = replays[_TICK, step]
    found, bounds = _furthest(replay.ours, replay.mujoco), np.minimum(_ASKED, _rounding(scenario, run))
    if int(mujoco.__version__.split(".")[0]) < 4:  # its base attitude is of order two
        bounds[1:] = _ASKED
    names = (("joints", "rad"), ("base position", "m"), ("base attitude", "rad"))
    for (name, unit), value, bound in zip(names, found, bounds, strict=True):
        record(f"{name} over 60 s, step {step * 1e-6:g} ms", value, bound, unit=unit, against=_AGAINST)


def test_the_step_hardly_matters(replays: Replays, record: Record) -> None:
    """Our plant with half the step: what is left of truncation, an answer to "is 1 ms small enough?"."""
    change = _furthest(replays[_TICK, _TICK].ours, replays[_TICK, _TICK // 2].ours)
    names = (("joints", "rad"), ("base position", "m"), ("base attitude", "rad"))
    for (name, unit), value in zip(names, change, strict=True):
        record(f"{name} over 60 s: change when 1 ms is halved", value, _ASKED, unit=unit, against="our plant")


def test_ours_converges_with_order_four(replays: Replays, record: Record) -> None:
    """Over 60 s too, with efforts held over 20 ms."""
    for name, measured in zip(("joints", "base position", "base attitude"), _orders(replays)[0], strict=True):
        record(f"order of {name} over 60 s: distance from 4", abs(measured - 4.0), _ORDER_TOLERANCE,
               against="theory")  # fmt: skip


def _orders(replays: Replays) -> tuple[Array, Array]:
    """Return the measured orders of joints, base position and base angle, ours and MuJoCo's."""
    cases = [replays[_COARSE, step] for hold, step in _CASES if hold == _COARSE]
    pairs = list(pairwise(cases))
    ours = order(np.array([_furthest(a.ours, b.ours) for a, b in pairs]))
    return ours, order(np.array([_furthest(a.mujoco, b.mujoco) for a, b in pairs]))


@pytest.mark.parametrize("step", [_TICK, _TICK // 2])
def test_ours_loses_no_more_momentum(
    scenario: Scenario, run: RunData, replays: Replays, record: Record, step: int
) -> None:
    """The run starts at rest, so all momentum is error.

    Beyond MuJoCo's, ours may have gained what rounding adds: a random walk of one eps of the arms'
    momentum per step. That momentum is their mass times the fastest joint times the reach of an arm.
    """
    replay = replays[_TICK, step]
    ours, others = _drift(scenario, replay.ours), _drift(scenario, replay.mujoco)
    arms = sum(arm.mass for arm in scenario.truth.robot.description.arms)
    momentum = arms * np.max(np.abs(run.joint_velocity)) * _REACH
    walk = np.sqrt(run.tick_ns[-1] / step) * _EPS * momentum
    for name, unit, mine, other, lever in zip(
        ("linear", "angular"), ("kg m/s", "kg m^2/s"), ours, others, (1.0, _REACH), strict=True
    ):
        claim = f"{name} momentum gained over 60 s, step {step * 1e-6:g} ms"
        record(claim, mine, other + lever * walk, unit=unit, against=_AGAINST)


def test_table_of_steps(scenario: Scenario, replays: Replays, table: Table) -> None:
    """What a reader compares: agreement and momentum at every step."""
    lines = [
        "Largest differences over 60 s. Efforts held over 20 ms are those of the run, averaged, so that "
        "steps above 1 ms can be compared.",
        "",
        "| efforts held [ms] | step [ms] | ours - MuJoCo: joints [rad] | base [m] | base [rad] "
        "| momentum gained, ours [kg m/s, kg m^2/s] | MuJoCo |",
        "|---|---|---|---|---|---|---|",
    ]
    for (hold, step), replay in replays.items():
        cells = [f"{hold * 1e-6:g}", f"{step * 1e-6:g}"]
        cells += [f"{x:.1e}" for x in _furthest(replay.ours, replay.mujoco)]
        for states in (replay.ours, replay.mujoco):
            cells.append(", ".join(f"{x:.2e}" for x in _drift(scenario, states)))
        lines.append("| " + " | ".join(cells) + " |")
    shown = [", ".join(f"{x:.2f}" for x in measured) for measured in _orders(replays)]
    lines += ["", f"Measured order (joints, base position, base attitude): ours {shown[0]}; "
              f"{_AGAINST} {shown[1]}."]  # fmt: skip
    table("\n".join(lines))
