"""Compiled loop: how fast whole handovers run in one process, and which part takes how long."""

from collections.abc import Callable
from functools import partial
from time import process_time
from unittest.mock import patch

from benchmarks.mujoco_rollout import THREADS, replay_of
from benchmarks.results import Result, Table, publish, row
from benchmarks.tick_operations import operations
from benchmarks.timing import Timings, interleaved
from sms_handover.compiled.kinematics import CompiledKinematics
from sms_handover.simulation import loop as loop_module
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.period_runner import PythonRunner
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import run_of, simulate
from sms_handover.simulation.wiring import make_ik
from sms_handover.types import IkRequest
from sms_handover.units import NS_PER_S

SIMULATED_S = 60.0  # s of a handover
ROUNDS, _LOADED_ROUNDS = 5, 40
RUNS = tuple((scenario, law) for scenario in ("paper", "smooth") for law in ("nmpc", "pid"))
_TICKS, _CALLS = 20, 50  # ticks of a period, and calls of a part in a row
_DEPUTY_KG, _HELD_S = 4.0, 21.0  # mass of the payload; a time at which it is held
_ROLLOUT = "paper, nmpc: efforts replayed by MuJoCo's rollout"
_NOMINAL, _ITS_IDEAL = "smooth, nmpc: conditions nominal", "smooth, nmpc"
_BARE, _LOADED, _NOMINAL_TICK = "without mass", f"{_DEPUTY_KG:g} kg", "without mass, conditions nominal"
_LONG = 1000  # ticks in a row


def compiled(name: str, law: str, conditions: str = "ideal") -> Scenario:
    """Return a scenario with compiled dynamics, under some conditions."""
    return load_scenario(name, {"law": law, "common.dynamics": "compiled", "common.conditions": conditions})


def by_period(scenario: Scenario) -> None:
    """Run it with its ticks in C and its reference periods in Python."""
    loop = Loop(scenario)
    loop._quiet = None
    run_of(loop)


def by_tick(scenario: Scenario) -> None:
    """Run it with ticks and periods in Python, and the equations in C."""
    with patch.object(
        loop_module, "make_runner", lambda plant, controller, *_: PythonRunner(plant, controller)
    ):
        run_of(Loop(scenario))


def ticks_of(mass: float, conditions: str = "ideal") -> Callable[[], object]:
    """Return what carries out ticks in C while the deputy is held, of this mass in kg."""
    values = {
        "law": "nmpc",
        "common.dynamics": "compiled",
        "deputy.mass": mass,
        "common.conditions": conditions,
    }
    loop = Loop(load_scenario("paper", values))
    while loop.state.stamp_ns < _HELD_S * NS_PER_S or not loop.deputy.holder:
        loop.advance_period()
    return partial(loop._runner.run, _LONG, _LONG)


def parts(scenario: Scenario) -> tuple[Timings, dict[str, int]]:
    """Return the times of parts of a period, and how often each is called in its contestant."""
    robot, parameters = scenario.model.robot, scenario.parameters
    loop = Loop(scenario)
    loop.advance_period()
    solve = make_ik(robot, parameters.common, parameters.ik)
    state = loop.state
    tools = robot.tools_at(state.q)
    request = IkRequest(state.base_in_world, state.joint_position, tools)
    kinematics = CompiledKinematics(robot)

    def repeated(part: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            for _ in range(_CALLS):
                part()

        return run

    found = interleaved(
        {
            "20 ticks: law, limits, step, sums, record": repeated(partial(loop._runner.run, _TICKS, _TICKS)),
            "inverse kinematics near its solution": repeated(partial(solve, request)),
            "tools of both arms": repeated(partial(kinematics.tools_at, state.q)),
            "momenta, energy, centre of mass": repeated(partial(kinematics.conserved, state.q, state.v)),
        },
        ROUNDS,
        process_time,
    )
    return found, dict.fromkeys(found.seconds, _CALLS)


def main() -> None:
    """Measure and publish."""
    runs: dict[str, Callable[[], object]] = {}
    for name, law in RUNS:
        runs[f"{name}, {law}"] = partial(simulate, compiled(name, law))
    first = compiled(*RUNS[0])
    runs[_NOMINAL] = partial(simulate, compiled("smooth", "nmpc", "nominal"))
    runs["paper, nmpc: periods by Python"] = partial(by_period, first)
    runs["paper, nmpc: periods and ticks by Python"] = partial(by_tick, first)
    runs[_ROLLOUT] = replay_of(first)
    times = interleaved(runs, ROUNDS, process_time)
    held = {
        _BARE: ticks_of(0.0),
        _LOADED: ticks_of(_DEPUTY_KG),
        _NOMINAL_TICK: ticks_of(0.0, "nominal"),
    }
    ticks = interleaved(held, _LOADED_ROUNDS, process_time)
    base = next(iter(runs))
    cases = {name: THREADS if name == _ROLLOUT else 1 for name in runs}
    speed = {name: SIMULATED_S * cases[name] / times.best(name) for name in runs}
    rows = [
        row(name, times.best(name) / cases[name], speed[name], times.ratio(name, base) / cases[name])
        for name in runs
    ]
    per_tick = [row(name, 1e6 * ticks.best(name) / _LONG, ticks.ratio(name, _BARE)) for name in held]
    counts = operations(compiled("smooth", "nmpc"), compiled("smooth", "nmpc", "nominal"))
    ideal, nominal = (sum(count[index] for count in counts.values()) for index in range(2))
    counted = [(name, str(one), str(other)) for name, (one, other) in counts.items()]
    counted.append(("together", str(ideal), f"{nominal}, {nominal / ideal:.2f} times as many"))
    split, calls = parts(first)
    cells = [row(name, 1e6 * split.best(name) / calls[name]) for name in split.seconds]
    publish(
        Result(
            name="compiled_loop",
            question="How fast is a handover in one process with compiled dynamics?",
            notes=[
                "60 s of simulated time with everything recorded, one case on one core; loading the scenario "
                "is not in it. All took turns; the shortest processor time counts. The second table has "
                "parts called from Python one by one, so with the cost of a call; in quiet periods C calls "
                "them itself. The third has ticks in C while a deputy is held, under a law that knows it. Of "
                f"{_NOMINAL.split(': ')[1]} sensors are left out, since nothing goes by them; the run "
                f"takes {times.ratio(_NOMINAL, _ITS_IDEAL):.2f} times as long as the ideal one beside it. "
                "The fourth counts what its equations take, if friction is solved at once; where joints turn "
                "back or stick, it has factors and acceleration again. Noise, wrenches and accounts are the "
                f"rest. MuJoCo's rollout replays the efforts of the first by RK4, {THREADS} cases on "
                f"{THREADS} threads, per case: no law, inverse kinematics, momenta or record of periods."
            ],
            tables=[
                Table(("run", "s", "times real time", "time over the first"), rows),
                Table(("part of a reference period", "us"), cells),
                Table(("deputy that is held", "us per tick", "time over the first"), per_tick),
                Table(("operations of the equations in a tick", "ideal", "nominal"), counted),
            ],
            values={
                **speed,
                "tick with payload over tick without": ticks.ratio(_LOADED, _BARE),
                "nominal over ideal": times.ratio(_NOMINAL, _ITS_IDEAL),
                "nominal tick over ideal": ticks.ratio(_NOMINAL_TICK, _BARE),
            },
        )
    )


if __name__ == "__main__":
    main()
