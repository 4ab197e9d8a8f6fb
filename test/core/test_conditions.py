"""Conditions of a run: each acts, none moves another, all are repeated by reset, snapshot and seed."""

import json
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.conservation import physics_residuals
from sms_handover.conditions.conditions import IDEAL
from sms_handover.configuration.conditions_content import condition_names
from sms_handover.configuration.field_specification import MappingSpec
from sms_handover.configuration.sensor_fields import SENSOR_FIELDS
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.plant.sensed_plant import SensedPlant
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import plain
from test.evidence import Record

ROTOR: dict[str, Any] = {"rotor_inertia": 0.31}
_FORCE = {"force": [0.5, 0.1, 0.0], "torque": [0.0, 0.1, 0.0]}
_ORBIT = {"radius": 6.778e6, "radial": [1.0, 0.2, 0.0], "normal": [0.0, 0.0, 1.0]}
EFFECTS: dict[str, dict[str, Any]] = {
    "friction.viscous": {"friction.viscous": 0.2},
    "friction.coulomb": {"friction.coulomb": 0.05},
    "torque.gain": {"torque.gain": 0.05},
    "torque.offset": {"torque.offset": 0.05},
    "torque.step": {"torque.step": 0.01},
    "torque.noise_density": {"torque.noise_density": 0.003},
    "command.delay": {"command.delay": 0.003},
    "command.dropped": {"command.dropped": 0.2},
    "constant": {"wrenches.leak.constant": _FORCE},
    "thruster_misfire": {
        "wrenches.misfire.thruster_misfire": {
            **{"force": [1.0, 0.0, 0.0], "point": [0.0, 0.5, 0.0]},
            **{"start": 0.0103, "duration": 0.0205},
        }
    },
    "history": {"wrenches.told.history": {"rows": [[0.0, 1, 0, 0, 0, 0, 0], [1.0, 0, 1, 0, 0, 0, 1]]}},
    "gravity_gradient": {"wrenches.gravity.gravity_gradient": _ORBIT},
    "relative_orbit": {"wrenches.hill.relative_orbit": {**_ORBIT, "reference": [3.0, 0.0, 0.0]}},
    "sensors.encoders": {"sensors.encoders": {"step": 3e-5, "bandwidth": 100.0}},
    "sensors.gyro": {"sensors.gyro.noise_density": 3e-5},
    "sensors.star_tracker": {"sensors.star_tracker": {"noise": 1e-4, "period": 0.02, "latency": 0.02}},
    "sensors.vision": {
        "sensors.vision": {"position_noise": 0.002, "period": 0.02, "latency": 0.01, "dropped": 0.2}
    },
    "model_error.base": {"model_error.base.mass": 0.05},
    "model_error.links": {"model_error.links.com": 0.005},
    "model_error.mounts": {"model_error.mounts.angle": 0.002},
}
SENSED: dict[str, dict[str, Any]] = {
    "encoders": {"step": 3e-5, "offset": [k * 1e-4 for k in range(14)], "bandwidth": 90.0},
    "gyro": {"noise_density": 3e-5, "bias": [1e-5, -2e-5, 3e-5], "period": 0.003},
    "star_tracker": {"noise": 1e-4, "bias": [1e-4, 2e-4, -3e-4], "period": 0.0, "latency": 0.05},
    "vision": {
        **{"position_noise": 0.002, "angle_noise": 0.003, "period": 0.1, "latency": 0.07, "dropped": 0.2},
        **{"position_bias": [1e-3, 2e-3, 3e-3], "angle_bias": [4e-3, 5e-3, 6e-3], "camera": [0.1, 0.2, 0.3]},
    },
}
EVERYTHING = {path: value for effect in EFFECTS.values() for path, value in effect.items()}


def _scenario(effects: dict[str, Any], seconds: float = 0.06, **more: Any) -> Scenario:
    """Return a short handover towards step targets, with rotors, under some effects.

    What is measured is what the loop goes by.
    """
    if any(path.startswith("sensors") for path in effects):
        more = {"common.source": "measured", **more}
    conditions = {f"conditions.{path}": value for path, value in {**ROTOR, **effects}.items()}
    return load_scenario("colliding", {"common.duration": seconds, **conditions, **more})


@pytest.fixture(scope="module")
def ideal_run() -> RunData:
    """The run with rotors and nothing else."""
    return simulate(_scenario({}))


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_acts(effect: str, ideal_run: RunData) -> None:
    run = simulate(_scenario(EFFECTS[effect]))
    assert np.abs(run.joint_velocity - ideal_run.joint_velocity).max() > 1e-12


def test_values_read_back_from_the_plant_are_those_of_the_file() -> None:
    """Of every effect, by the objects that compute with it; a drawn body is that of the description."""
    scenario = _scenario({**EVERYTHING, "friction.stribeck_speed": 0.02, "friction.stiction": 0.07}, 0.02)
    applied = json.loads(simulate(scenario).applied)
    for path, asked in {**EVERYTHING, "friction.stribeck_speed": 0.02, "friction.stiction": 0.07}.items():
        section, _, name = path.partition(".")
        if section == "wrenches":
            wrench, kind = name.split(".")
            found = applied["wrenches"][wrench]
            assert found["acts_on"] == "base"
            for key, value in asked.items():
                unit = np.linalg.norm(value) if key in ("radial", "normal") else 1.0
                assert np.array(found[kind][key]) * unit == pytest.approx(np.array(value), rel=1e-12), path
        elif section not in ("model_error", "sensors"):
            assert np.array(applied[section][name]) == pytest.approx(asked, rel=1e-12), path
    true, known = (world.robot.description.base.inertia.mass for world in (scenario.truth, scenario.model))
    assert applied["robot"]["bodies"]["root_joint"]["mass"] == pytest.approx(true)
    assert true != known
    assert set(applied["robot"]["rotor_inertia"].values()) == {0.31}


def test_values_of_every_sensor_are_read_back_whether_it_is_read_or_not() -> None:
    """Every key of the file, alike where the loop goes by sensors, where it does not, and where C runs it."""
    kinds = SENSOR_FIELDS.optional.items()
    known = {name: set(spec.optional) for name, spec in kinds if isinstance(spec, MappingSpec)}
    assert {name: set(values) for name, values in SENSED.items()} == known
    asked = {"conditions.sensors": SENSED, "conditions.command.delay": 0.02}
    texts = []
    for source, dynamics in (("measured", "pinocchio"), ("truth", "pinocchio"), ("truth", "compiled")):
        loop = Loop(load_scenario("smooth", {**asked, "source": source, "common.dynamics": dynamics}))
        assert isinstance(loop._plant, SensedPlant) is (dynamics != "compiled")
        texts.append(loop.applied)
    assert len(set(texts)) == 1
    found = json.loads(texts[0])["sensors"]
    assert found["gyro"].pop("noise_density") == pytest.approx(SENSED["gyro"]["noise_density"], rel=1e-12)
    joints = {"step": [3e-5] * 14, "offset": [k * 1e-4 for k in range(14)]}
    gyro = {key: value for key, value in SENSED["gyro"].items() if key != "noise_density"}
    assert found == {**SENSED, "encoders": {**SENSED["encoders"], **joints}, "gyro": gyro}


def test_momentum_and_energy_are_accounted_for_with_everything_on(record: Record) -> None:
    """Less what wrenches have given and friction has taken, within the bounds of docs/verification.md."""
    residuals = physics_residuals(simulate(_scenario(EVERYTHING, 0.2)))
    for what, value, bound, unit in (
        ("P less impulse", residuals.linear_momentum, 1e-12, "N s"),
        ("L less impulse", residuals.angular_momentum, 1e-11, "N m s"),
        ("E less work and outside work, with losses", residuals.energy, 1e-8, "J"),
    ):
        claim = f"{what}, all effects at once in a handover, 0.2 s at 1 ms"
        record(claim, value, bound, unit=unit, against="conservation")


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_reset_snapshot_and_seed_repeat_the_noise(law: str) -> None:
    loop = Loop(_scenario(EVERYTHING, law=law))

    def rest() -> list[Any]:
        return [plain(loop.advance_period().rows) for _ in range(2)]

    first, (snapshot, second) = rest(), (loop.snapshot(), rest())
    loop.reset()
    assert rest() == first
    loop.restore(snapshot)
    assert rest() == second
    loop.reset(seed=5)
    assert rest() != first
    other = Loop(_scenario(EVERYTHING, law=law))
    other.restore(snapshot)
    assert [plain(other.advance_period().rows) for _ in range(2)] == second


def test_one_effect_moves_no_draw_of_another() -> None:
    """What is drawn for an effect is the same beside every other one: all pairs of those that draw."""

    def draws(given: dict[str, Any]) -> dict[str, Any]:
        scenario = _scenario(given)
        loop, robot = Loop(scenario), scenario.truth.robot.description
        found: dict[str, Any] = {"model_error.base": robot.base.inertia.mass}
        found["model_error.links"] = [link.inertia.com for arm in robot.arms for link in arm.links]
        found["model_error.mounts"] = [arm.mount.rpy for arm in robot.arms]
        effects = loop._plant._effects
        if effects and effects.motor:
            found["torque.noise_density"] = [effects.motor._noise.normal(k).tolist() for k in range(5)]
        if effects and effects.path:
            found["command.dropped"] = [effects.path._losses.uniform(k).tolist() for k in range(5)]
        if isinstance(loop._plant, SensedPlant):
            for name, sensor in loop._plant.sensors._sensors.items():
                if hasattr(sensor, "_noise"):
                    found[f"sensors.{name}"] = [sensor._noise.normal(k).tolist() for k in range(5)]
        return found

    drawn = ("model_error", "torque.n", "command.d", "sensors.g", "sensors.s", "sensors.v")
    random = [name for name in EFFECTS if name.startswith(drawn)]
    alone = {name: draws(EFFECTS[name]) for name in random}
    for one, other in combinations(random, 2):
        both = draws({**EFFECTS[one], **EFFECTS[other]})
        for name in (one, other):
            if name in both:
                assert both[name] == alone[name][name], (one, other)


def test_ideal_conditions_are_the_default_and_nothing() -> None:
    assert load_scenario("smooth").truth.conditions is IDEAL
    named = load_scenario("smooth", {"common.conditions": "ideal"})
    assert named.truth.conditions is IDEAL
    assert named.truth is named.model


def test_the_model_knows_rotors_and_nothing_else() -> None:
    scenario = _scenario(EVERYTHING)
    assert scenario.model.conditions is IDEAL
    known, true = scenario.model.robot, scenario.truth.robot
    assert np.all(known.pin.armature[6:] == 0.31) and np.all(true.pin.armature[6:] == 0.31)
    assert known.description.base.inertia == load_scenario("colliding").truth.robot.description.base.inertia
    assert true.description.base.inertia.mass != known.description.base.inertia.mass


def test_every_level_runs_with_every_kind_of_robot() -> None:
    for level in condition_names():
        for name in ("planar", "six_joints", "three_arms"):
            simulate(load_scenario(name, {"common.conditions": level, "common.duration": 0.04}))


def test_conditions_come_from_a_file_a_scenario_and_paths_in_this_order(tmp_path: Path) -> None:
    (tmp_path / "drag.csv").write_text("0, 1, 0, 0, 0, 0, 0\n2, 3, 0, 0, 0, 0, 0\n")
    file = tmp_path / "mine.yaml"
    file.write_text(
        "rotor_inertia: 0.3\nfriction: {coulomb: 0.1, viscous: 0.2}\n"
        "wrenches: {drag: {history: {file: drag.csv}}}\n"
    )
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("extends: smooth\nconditions: {extends: mine.yaml, friction: {viscous: 0.4}}\n")
    found = load_scenario(scenario, {"conditions.friction.coulomb": [0.2] * 14}).truth.conditions
    assert found.friction is not None
    assert found.friction.viscous.tolist() == [0.4] * 14
    assert found.friction.coulomb.tolist() == [0.2] * 14
    assert found.friction.stiction.tolist() == [0.2] * 14
    wrench = found.wrenches["drag"].over(0.5, 1.0, None)  # type: ignore[arg-type]
    assert wrench.force.tolist() == [2.0, 0.0, 0.0]
    given = load_scenario(scenario, {"common.conditions": "ideal"})
    assert given.truth.conditions is IDEAL


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"friction.coulomb": 0.1}, "friction needs the inertia of rotors, and that of arm_a_joint_1 is 0"),
        ({"torque.step": 0.1}, r"torque\.step needs the inertia of rotors"),
        ({"torque.noise_density": 0.1}, r"torque\.noise_density needs the inertia of rotors"),
        ({"rotor_inertia": 0.3, "friction.coulomb": -1}, r"coulomb is -1 N m, must be >= 0 N m"),
        ({"rotor_inertia": 0.3, "friction.coulomb": [1.0]}, r"coulomb is \[1.0\], must be 14 numbers in N m"),
        ({"rotor_inertia": [0.3] * 15}, r"arm_b\.rotor_inertia is .*must be 7 numbers in kg m\^2"),
        ({"command.delay": 0.0005}, "delay is 0.0005 s, must be a multiple of the tick of 0.001 s"),
        ({"wrenches.w.constant": {"force": [0, 0, 0]}}, r"wrenches\.w\.constant\.torque is missing"),
        ({"wrenches.w.constant.force": [0, 0, 0]}, r"^conditions\.wrenches\.w\S*:=.*: .*torque is missing"),
        ({"rotor_inertia": 0.3, "friction.viscous": [1]}, r"^conditions\.friction\.viscous:=\[1\]: friction"),
        ({"wrenches.w": {}}, "wrench 'w' must have exactly one of constant"),
        ({"wrenches.w.history.rows": [[0, 1]]}, "row 0 is .*must be 7 numbers"),
    ],
)
def test_an_error_says_what_is_wrong_and_how_to_mend_it(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        Loop(load_scenario("smooth", {f"conditions.{path}": value for path, value in values.items()}))


def test_an_unknown_level_or_value_is_told_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'nominal'"):
        load_scenario("smooth", {"common.conditions": "nominl"})
    with pytest.raises(UnknownNameError, match=r"conditions\.friction\.coulomb"):
        load_scenario("smooth", {"conditions.friction.colomb": 0.1})


@pytest.mark.parametrize("law", ["nmpc", "pid", "mpc"])
def test_a_tenth_of_the_friction_of_a_gen3_is_stable_at_a_tick_of_1_ms(law: str, record: Record) -> None:
    """At a quarter of the tick the joints are where they were, and none has turned back and forth."""
    friction = {
        **{"friction.viscous": 0.2, "friction.coulomb": 0.25},
        **{"friction.stiction": 0.3, "friction.stribeck_speed": 0.01},
    }
    coarse, fine = (
        simulate(_scenario(friction, 0.3, law=law, **{"common.tick": tick})) for tick in (1e-3, 0.25e-3)
    )
    rates = coarse.joint_velocity
    assert np.abs(rates).max() > 0.01
    turns = np.count_nonzero((rates[1:] * rates[:-1] < 0.0) & (np.abs(rates[1:]) > 1e-6), axis=0)
    assert turns.max() <= 2
    apart = np.abs(coarse.joint_position[-1] - fine.joint_position[-1]).max()
    claim = f"joints at 0.3 s under {law}, rotors and a tenth of the Gen3's friction, a tick of 1 ms"
    record(claim, apart, 2e-4, unit="rad", against="a quarter of the tick")
