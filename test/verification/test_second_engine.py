"""Runs replayed in second engines: efforts of whole runs, by the command verify --with.

Each engine is given the description and the recorded efforts, and nothing else of ours.
"""

from dataclasses import replace

import pytest

from sms_handover.engines.protocol import Effect, Engine
from sms_handover.engines.registry import ENGINES, load_engine
from sms_handover.engines.verdict import verdict_of
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.parts import Inertia
from sms_handover.model.robot_model import RobotModel
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from test.evidence import Record

_HEAVIER = 1.001  # [-] what a link weighs that is to be noticed
_SHORT = {"common": {"duration": 2.0}}  # [s]
_TURN = [1e-3, -5e-4, 7e-4]  # [rad/s]
_WRENCHES = {
    "gravity": {"gravity_gradient": {"radius": 6.778e6, "radial": [1, 0, 0], "normal": [0, 0, 1]}},  # m
    "misfire": {
        "thruster_misfire": {"force": [1, 0.5, 0.3], "point": [0, 0.5, 0.2], "start": 0.5, "duration": 0.05}
    },  # N, m, s
    "leak": {"constant": {"force": [0, -0.01, 0.002], "torque": [0.01, 0.02, -0.01], "point": [0.1, 0, 0]}},
}
_EFFECTS: dict[Effect, dict[str, object]] = {
    Effect.ROTOR_INERTIA: {"robot.arms.arm_a.rotor_inertia": [0.1, 0.2]},  # kg m^2
    Effect.WRENCHES: {"conditions.wrenches": _WRENCHES},
    Effect.FRICTION: {"conditions": {"rotor_inertia": 0.3, "friction": {"coulomb": 0.1, "stiction": 0.1}}},
}
_SCENARIOS = ("planar", "one_arm")  # every shipped one: make engines


@pytest.fixture(scope="module", params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Engine:
    """Each engine whose package is there; that of Basilisk needs an environment of its own, make engines."""
    entry = ENGINES[request.param]
    pytest.importorskip(entry.imported, reason=f"{entry.package} is not in this environment: make engines")
    return load_engine(request.param)


@pytest.fixture(scope="module", params=_SCENARIOS)
def whole(request: pytest.FixtureRequest) -> tuple[str, Scenario, RunData]:
    """A whole run of a scenario."""
    scenario = load_scenario(request.param)
    return request.param, scenario, simulate(scenario)


@pytest.fixture(scope="module", params=["smooth"])
def short(request: pytest.FixtureRequest) -> tuple[str, Scenario, RunData]:
    """Two seconds of a run."""
    scenario = load_scenario(request.param, _SHORT)
    return request.param, scenario, simulate(scenario)


def test_a_whole_run_is_within_its_bounds(
    engine: Engine, whole: tuple[str, Scenario, RunData], record: Record
) -> None:
    name, scenario, run = whole
    verdict = verdict_of(engine, run, scenario, name)
    assert len(verdict.differences) == 7 and verdict.states == run.reference_ns.size
    for each in verdict.differences:
        claim = f"{name}: {each.quantity}"
        record(claim, each.largest, each.bound, unit=each.unit, against=engine.title)


def test_a_thousandth_of_a_link_is_noticed(engine: Engine, short: tuple[str, Scenario, RunData]) -> None:
    """0.1 % more mass of any one link, in what the engine is given, is beyond the bounds in two seconds."""
    name, scenario, run = short
    assert verdict_of(engine, run, scenario, name).agrees
    for heavier in _each_heavier(scenario.truth.robot.description):
        world = replace(scenario.truth, robot=RobotModel(heavier))
        assert not verdict_of(engine, run, replace(scenario, truth=world), name).agrees


def _each_heavier(robot: RobotDescription) -> list[RobotDescription]:
    """Return the robot once for the base and once for each link, which weighs a thousandth more."""
    found = [replace(robot, base=replace(robot.base, inertia=_more(robot.base.inertia)))]
    for number, arm in enumerate(robot.arms):
        for index, link in enumerate(arm.links):
            links = [*arm.links]
            links[index] = replace(link, inertia=_more(link.inertia))
            arms = [*robot.arms]
            arms[number] = replace(arm, links=tuple(links))
            found.append(replace(robot, arms=tuple(arms)))
    return found


def _more(inertia: Inertia) -> Inertia:
    return replace(inertia, mass=_HEAVIER * inertia.mass)


@pytest.mark.parametrize("effect", [Effect.ROTOR_INERTIA, Effect.WRENCHES, Effect.FRICTION])
def test_an_effect_is_known_or_said_not_to_be(engine: Engine, effect: Effect, record: Record) -> None:
    """MuJoCo has rotors and pushes the base; Basilisk's spinning bodies have no rotors, to name one."""
    scenario = load_scenario("planar", {**_SHORT, **_EFFECTS[effect]})
    verdict = verdict_of(engine, simulate(scenario), scenario, "planar")
    lacked = min((each for each in engine.lacks if each in _present(effect)), key=_name, default=None)
    assert verdict.unsupported == (f"{_name(lacked)}: {engine.lacks[lacked]}" if lacked else "")
    for each in verdict.differences:
        claim = f"planar with {_name(effect)}: {each.quantity}"
        record(claim, each.largest, each.bound, unit=each.unit, against=engine.title)


def _name(effect: Effect) -> str:
    return effect.value


def _present(effect: Effect) -> set[Effect]:
    """Return the effects of a case: friction needs rotors."""
    return {effect, Effect.ROTOR_INERTIA} if effect is Effect.FRICTION else {effect}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("planar", {"deputy.mass": 4.0}),  # kg
        (
            "one_arm",  # a deputy that drifts and turns past a hand at rest: mm/s, deg/s
            {
                "deputy": {"mass": 4.0, "twist_in_world": {"linear": [4e-4, -3e-4, 2e-4], "angular": _TURN}},
                "plant": {"grasp_position_tolerance": 0.05, "grasp_angle_tolerance": 0.1},
                "common": {"duration": 22.0},
            },
        ),
    ],
)
def test_a_deputy_with_mass_is_captured_alike(
    engine: Engine, name: str, values: dict[str, object], record: Record
) -> None:
    """MuJoCo computes the impulse of each grasp by its own mass matrices, and goes on with a new model."""
    if Effect.DEPUTY_MASS in engine.lacks:
        scenario = load_scenario(name, {**values, "common": {"duration": 0.1}})
        verdict = verdict_of(engine, simulate(scenario), scenario, name)
        assert verdict.unsupported.startswith("a deputy with mass: ") and not verdict.agrees
        return
    scenario = load_scenario(name, values)
    verdict = verdict_of(engine, simulate(scenario), scenario, name)
    found = {each.quantity: each for each in verdict.differences}
    assert {"impulse", "impulsive moment", "deputy position", "deputy attitude"} <= found.keys()
    for each in verdict.differences:
        claim = f"{name}, a deputy of 4 kg: {each.quantity}"
        record(claim, each.largest, each.bound, unit=each.unit, against=engine.title)
