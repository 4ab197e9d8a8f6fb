"""Sensors against closed forms and known statistics, and what is done with what they tell."""

from base64 import b64decode
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import exp, radians, sqrt
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.conditions.sensors.encoders import EncoderValues
from sms_handover.conditions.sensors.gyro import GyroValues
from sms_handover.conditions.sensors.sensor import Known, Reading, Sensor, SensorValues, Setting, Truth
from sms_handover.conditions.sensors.star_tracker import StarTrackerValues
from sms_handover.conditions.sensors.vision import VisionValues
from sms_handover.errors import ConfigurationError
from sms_handover.export.run_tables import run_tables
from sms_handover.model.poses import pose_distance
from sms_handover.report.plots import plot_groups
from sms_handover.run_data import RunData
from sms_handover.scene.document import scene_document
from sms_handover.scene.scene import make_scene
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, Pose
from test.evidence import Record

MS = 1_000_000  # [ns]
_EPS = float(np.finfo(float).eps)
_NOWHERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # a base at the origin of world
_DEPUTY = Pose(np.array([1.2, 0.0, 0.5]), np.array([0.0, 0.0, 0.0, 1.0]))  # 1.3 m away
_EXACT = VisionValues(0.0, 0.0, np.zeros(3), np.zeros(3), 0.1, 0.03, 0.0, np.zeros(3))
MEASURED = ("joint_position", "joint_velocity", "base_pose", "base_twist", "deputy_pose")
_RATE = np.array([0.1, -0.2, 0.3])  # [rad/s]
SENSORS: dict[str, Any] = {
    "conditions.sensors.encoders": {"step": 3e-5, "bandwidth": 100.0},
    "conditions.sensors.gyro": {"noise_density": 3e-5, "bias": [1e-5, 0.0, 0.0]},
    "conditions.sensors.star_tracker": {"noise": 1e-4, "period": 0.02, "latency": 0.01},
    "conditions.sensors.vision": {"position_noise": 0.002, "period": 0.02, "latency": 0.01},
}


def setting(tick_ns: int = MS, joints: int = 2, seed: int = 3) -> Setting:
    return Setting(joints, tick_ns, RandomStreams(seed))


def told(sensors: Sequence[Sensor], tick: int, q: Array, v: Array, deputy: Pose = _DEPUTY) -> Known:
    """Return what is known after some sensors have measured one after the other."""
    known = Known(np.array(q), np.array(v))
    for sensor in sensors:
        sensor.measure(Truth(tick, q, v, lambda: deputy), known)
    return known


def turning(seconds: float) -> Array:
    """Return the pose (7,) of a base that turns at a constant rate about an axis of its own."""
    return np.concatenate([np.zeros(3), pin.Quaternion(pin.exp3(_RATE * seconds)).coeffs()])


def test_encoders_give_whole_steps_of_the_angle_and_its_offset() -> None:
    step, offset = np.array([3e-5, 0.0]), np.array([0.0, 2e-4])
    encoders = EncoderValues(step, offset, 100.0).make(setting())
    angles = np.random.default_rng(0).uniform(-3.0, 3.0, (200, 2))
    for tick, angle in enumerate(angles):
        given = told([encoders], tick, np.concatenate([_NOWHERE, angle]), np.zeros(8)).q[7:]
        assert given[0] == 3e-5 * round(angle[0] / 3e-5)  # to the bit
        assert abs(given[0] - angle[0]) <= 1.5e-5 + 4 * _EPS
        assert given[1] == angle[1] + 2e-4


@pytest.mark.parametrize("tick_ns", [MS, MS // 4])
def test_the_rates_of_encoders_follow_the_closed_form_of_their_filter(tick_ns: int, record: Record) -> None:
    """Of a joint that begins to move at w: w (1 - exp(-c t)), whatever the tick; without a filter w."""
    rate, bandwidth, h = 0.3, 80.0, tick_ns * 1e-9
    none = np.zeros(2)
    filtered, bare = (EncoderValues(none, none, c).make(setting(tick_ns)) for c in (bandwidth, float("inf")))
    apart = 0.0  # [rad/s]
    for tick in range(60):
        q = np.concatenate([_NOWHERE, np.full(2, rate * tick * h)])
        expected = rate * (1.0 - exp(-bandwidth * tick * h))
        given = told([filtered], tick, q, np.zeros(8)).v[6:]
        apart = max(apart, float(np.abs(given - expected).max()))
        assert told([bare], tick, q, np.zeros(8)).v[6:] == pytest.approx([rate * (tick > 0)] * 2, abs=1e-12)
    claim = f"rate of encoders as a joint begins to move, a tick of {h * 1e3:g} ms"
    record(claim, apart, 1e-12, unit="rad/s", against="w (1 - exp(-c t))")


@pytest.mark.parametrize(("tick_ns", "period"), [(MS, 0.0), (MS // 4, 0.0), (MS, 0.002)])
def test_the_noise_of_a_gyro_has_its_density_whatever_the_tick(
    tick_ns: int, period: float, record: Record
) -> None:
    """The angle after T varies by D^2 T; of 600 samples that is known to 6 % (one sigma)."""
    density, h, bias = 0.003, tick_ns * 1e-9, np.array([0.01, 0.0, -0.02])
    gyro, v = GyroValues(density, bias, period).make(setting(tick_ns)), np.concatenate([np.ones(3), _RATE])
    per_sample = 40
    rates = np.array([told([gyro], k, _NOWHERE, v).v[3:6] for k in range(200 * per_sample)])
    errors = rates - _RATE - bias
    angles = h * errors.reshape(200, per_sample, 3).sum(axis=1)
    apart = abs(angles.var() / (density**2 * per_sample * h) - 1.0)
    claim = (
        f"noise of a gyro, a tick of {h * 1e3:g} ms, a period of {period * 1e3:g} ms: variance of its angle"
    )
    record(f"{claim}, relative error", apart, 0.2, against="the declared density")
    assert np.abs(errors.mean(axis=0)).max() < 4.0 * density / sqrt(h * len(rates))
    held = max(1, round(period / h))
    assert np.all(rates[::held] == rates[held - 1 :: held])  # until the next measurement
    assert not np.any(rates[held::held] == rates[:-held:held])


def test_a_star_tracker_is_late_by_whole_ticks_and_a_gyro_makes_up_for_it() -> None:
    """At a constant rate the orientation turned on by an exact gyro is the true one."""
    values = StarTrackerValues(0.0, np.zeros(3), 0.02, 0.007)
    alone, helped = values.make(setting()), values.make(setting())
    gyro, v = GyroValues(0.0, np.zeros(3), 0.0).make(setting()), np.concatenate([np.zeros(3), _RATE])
    for tick in range(100):
        q = turning(tick * 1e-3)
        measured = max(0, (tick - 7) // 20 * 20) * 1e-3
        assert told([alone], tick, q, v).q[3:] == pytest.approx(turning(measured)[3:], abs=1e-14)
        assert told([gyro, helped], tick, q, v).q[3:] == pytest.approx(q[3:], abs=1e-14)


def test_a_star_tracker_has_its_noise_and_bias(record: Record) -> None:
    values = StarTrackerValues(1e-3, np.array([0.0, 2e-3, 0.0]), 0.0, 0.0)
    tracker, q = values.make(setting()), turning(0.7)
    base = pin.Quaternion(q[3:])
    errors = [
        pin.log3((base.conjugate() * pin.Quaternion(told([tracker], k, q, np.zeros(6)).q[3:])).matrix())
        for k in range(1500)
    ]
    assert np.mean(errors, axis=0) == pytest.approx([0.0, 2e-3, 0.0], abs=4 * 1e-3 / sqrt(1500))
    apart = np.abs(np.std(errors, axis=0) / 1e-3 - 1.0).max()  # four sigma
    record("noise of a star tracker, relative error of sigma", apart, 0.08, against="the declared sigma")


def test_vision_is_late_by_whole_ticks() -> None:
    camera = _EXACT.make(setting())
    for tick in range(300):
        deputy = Pose(np.array([tick, 0.0, 1.0]), _DEPUTY.quaternion_xyzw)
        seen = told([camera], tick, _NOWHERE, np.zeros(6), deputy)
        assert seen.deputy_in_world is not None
        assert seen.deputy_in_world.position[0] == max(0, (tick - 30) // 100 * 100)


@pytest.mark.parametrize("distance", [1.0, 3.0])
def test_the_noise_of_vision_grows_with_range_and_its_bias_does_not(distance: float, record: Record) -> None:
    bias, askew, n = np.array([0.01, 0.0, -0.02]), np.array([0.0, 0.0, 0.05]), 1500
    camera = VisionValues(0.002, 0.01, bias, askew, 0.0, 0.0, 0.0, np.array([0.5, 0.0, 0.0])).make(setting())
    deputy = Pose(np.array([0.5, 0.0, distance]), _DEPUTY.quaternion_xyzw)
    seen = [told([camera], k, _NOWHERE, np.zeros(6), deputy).deputy_in_world for k in range(n)]
    places = np.array([pose.position for pose in seen if pose]) - deputy.position
    turns = np.array([pin.log3(pin.Quaternion(pose.quaternion_xyzw).matrix()) for pose in seen if pose])
    far, turned = 0.002 * distance, 0.01 * distance  # m, rad
    assert places.mean(axis=0) == pytest.approx(bias, abs=4 * far / sqrt(n))
    assert turns.mean(axis=0) == pytest.approx(askew, abs=4 * turned / sqrt(n))
    apart = np.abs([places.std(axis=0) / far - 1.0, turns.std(axis=0) / turned - 1.0]).max()
    claim = f"noise of vision at a range of {distance:g} m, relative error of sigma"
    record(claim, apart, 0.08, against="the declared sigma by range")


def test_vision_is_relative_to_the_base_as_it_is_known(record: Record) -> None:
    """A base that is taken to be turned by an angle sees the deputy turned about it by that angle."""
    angle = radians(1.0)
    tracker = StarTrackerValues(0.0, np.array([0.0, 0.0, angle]), 0.0, 0.0).make(setting())
    seen = told([tracker, _EXACT.make(setting())], 0, _NOWHERE, np.zeros(6)).deputy_in_world
    assert seen is not None
    turn = pin.exp3(np.array([0.0, 0.0, angle]))
    expected = Pose(turn @ _DEPUTY.position, pin.Quaternion(turn).coeffs())
    claim = "deputy by vision from a base that is taken to be turned by 1 deg"
    record(claim, max(pose_distance(seen, expected)), 1e-15, unit="m, rad", against="a turn about the base")


def test_as_many_measurements_of_vision_are_lost_as_is_declared() -> None:
    """And a lost one leaves the one before. A run begins with one, whatever becomes of it."""

    def placed(pose: Pose) -> Pose:
        return pose

    camera = replace(_EXACT, period=0.0, latency=0.0, dropped=0.3).make(setting())
    readings = list[Reading | None]()
    for tick in range(2000):
        deputy = Pose(np.array([tick, 0.0, 1.0]), _DEPUTY.quaternion_xyzw)
        known = Known(np.array(_NOWHERE), np.zeros(6))
        readings.append(camera.measure(Truth(tick, _NOWHERE, np.zeros(6), partial(placed, deputy)), known))
        latest = max((reading.tick for reading in readings if reading), default=0)
        assert known.deputy_in_world is not None and known.deputy_in_world.position[0] == latest
    assert readings.count(None) / 2000 == pytest.approx(0.3, abs=4 * sqrt(0.3 * 0.7 / 2000))


def test_one_sensor_moves_no_number_of_another() -> None:
    """Of the same truth: each tells the same, whichever others there are and whatever their rates."""
    base, n = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.2, 0.3]), np.zeros(2)

    def given(names: str, gyro_period: float = 0.0) -> dict[str, list[list[float]]]:
        values: dict[str, SensorValues] = {
            "encoders": EncoderValues(n + 1e-4, n, 100.0),
            "gyro": GyroValues(0.003, np.zeros(3), gyro_period),
            "star_tracker": StarTrackerValues(1e-3, np.zeros(3), 0.002, 0.0),
            "vision": replace(_EXACT, position_noise=0.01, period=0.002, latency=0.0, dropped=0.2),
        }
        sensors = {name: values[name].make(setting()) for name in names.split()}
        found: dict[str, list[list[float]]] = {name: [] for name in sensors}
        for tick in range(20):
            for name, sensor in sensors.items():
                reading = sensor.measure(
                    Truth(tick, base, np.zeros(8), lambda: _DEPUTY), Known(np.array(base), np.zeros(8))
                )
                found[name].append(reading.values.tolist() if reading else [])
        return found

    everything = given("encoders gyro star_tracker vision")
    for name in everything:
        assert given(name)[name] == everything[name], name
    slower = given("encoders gyro star_tracker vision", 0.004)
    assert slower["gyro"] != everything["gyro"]
    assert slower["vision"] == everything["vision"]
    ticks = [tick for tick, row in enumerate(everything["star_tracker"]) if row]
    rates = np.array([everything["gyro"][tick] for tick in ticks]) / (0.003 / sqrt(1e-3))
    turns = [pin.log3(pin.Quaternion(np.array(everything["star_tracker"][k][3:])).matrix()) for k in ticks]
    assert np.abs(rates - np.array(turns) / 1e-3).min() > 1e-6  # streams of their own: no number in common


# What is done with it


def handover(source: str, sensors: dict[str, Any], **more: Any) -> RunData:
    values = {"common.duration": 0.1, "common.source": source, "conditions.rotor_inertia": 0.31, **sensors}
    return simulate(load_scenario("colliding", {**values, **more}))


def test_sensors_alone_change_nothing() -> None:
    """They tell, but with the source truth nobody listens; all that is measured by nobody is the truth."""
    bare, sensed = handover("truth", {}), handover("truth", SENSORS)
    for name in ("joint_command", *MEASURED):
        assert getattr(bare, name).tobytes() == getattr(sensed, name).tobytes(), name
    measured = sensed.measured
    assert bare.measured is None and measured is not None
    for name in MEASURED:
        assert getattr(measured, name).tobytes() != getattr(sensed, name).tobytes(), name
    assert measured.base_pose[:, :3].tobytes() == sensed.base_pose[:, :3].tobytes()
    assert measured.base_twist[:, :3].tobytes() == sensed.base_twist[:, :3].tobytes()


def test_compiled_ticks_leave_sensors_out_where_nobody_listens() -> None:
    """The run is that without, bit for bit, but for their values; who listens is given what they tell."""
    compiled = {"common.dynamics": "compiled", "common.duration": 0.04}
    bare, unheard, heard = (
        simulate(load_scenario("colliding", {**compiled, **more}))
        for more in ({}, SENSORS, {"source": "measured", **SENSORS})
    )
    assert unheard.measured is None and heard.measured is not None
    assert [difference.field for difference in compare_runs(bare, unheard)] == ["applied"]
    assert unheard.applied == heard.applied
    assert compare_runs(bare, heard)


def test_a_law_of_ones_own_is_given_what_is_measured() -> None:
    told_of = list[tuple[Array, Array]]()

    class Listener:
        def reset(self) -> None:
            told_of.clear()

        def guide(self, guidance: Any) -> None:
            pass

        def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
            told_of.append((q, v))
            return np.zeros(14)

    values = {"common.duration": 0.04, "common.source": "measured", **SENSORS}
    run = simulate(load_scenario("colliding", values), controller=Listener())
    assert run.measured is not None
    measured = run.measured
    q, v = (np.array(rows) for rows in zip(*told_of, strict=True))
    assert np.array_equal(q, np.hstack([measured.base_pose, measured.joint_position]))
    assert np.array_equal(v, np.hstack([measured.base_twist, measured.joint_velocity]))


def test_the_trajectory_goes_by_what_is_measured() -> None:
    """A deputy that is seen 50 mm aside is gone for 50 mm aside, and a joint is held where it is read."""
    exact: dict[str, Any] = {"conditions.sensors.encoders": {}}
    aside = {"conditions.sensors.vision": {"position_bias": [0.0, 0.05, 0.0]}}
    offset = {"conditions.sensors.encoders": {"offset": 1e-3}}
    plain, seen, read = (handover("measured", sensors) for sensors in (exact, aside, offset))
    shift = seen.target_pose["arm_a"][-1] - plain.target_pose["arm_a"][-1]
    assert shift[:3] == pytest.approx([0.0, 0.05, 0.0], abs=1e-3)
    held = [name.startswith("arm_b") for name in plain.joint_names]
    more = (read.reference_position - plain.reference_position)[-1][held]
    assert more == pytest.approx([1e-3] * 7, abs=1e-6)


def test_report_scene_and_tables_have_truth_and_measurement() -> None:
    run = handover("measured", SENSORS)
    measured = run.measured
    assert measured is not None
    groups = {group.title: group for group in plot_groups([run])}
    plots = {plot.key: plot for plot in groups["Measurements"].plots}
    assert all(plot.lines for plot in plots.values()) and len(plots) == 8
    seen = next(line for line in plots["vision_position_error"].lines if line.series == 1)
    expected = 1e3 * (measured.deputy_pose - run.deputy_pose)[:, 1]  # [mm]
    assert np.array_equal(seen.values, expected)
    turn = plots["star_tracker_error"].lines[0]
    assert 0.0 < np.abs(turn.values).max() < np.degrees(6e-4)  # of 0.1 mrad
    assert "Measurements" not in [group.title for group in plot_groups([handover("truth", {})])]

    scenario = load_scenario("colliding")
    scene = make_scene(run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)
    document = scene_document("a", scene)
    bodies, packed = document["bodies"], document["poses"]
    assert isinstance(bodies, list) and bodies[-1] == "deputy/measured" and isinstance(packed, str)
    poses = np.frombuffer(b64decode(packed), "<f4").reshape(len(scene.stamp_ns), len(bodies), 7)
    periods = np.searchsorted(run.reference_ns, scene.stamp_ns)
    assert np.array_equal(poses[:, -1], measured.deputy_pose[periods].astype("<f4"))

    ticks, references, *_ = run_tables(run, lambda stamps: np.ones(len(stamps), dtype=bool))
    names = [column.name for column in ticks.columns]
    velocity = ticks.values[names.index("arm_a_joint_2.measured_velocity")]
    assert np.array_equal(velocity, measured.joint_velocity[:, 1])
    assert "deputy.measured.position.x" in [column.name for column in references.columns]


def test_a_comparison_of_runs_tells_where_measurements_differ() -> None:
    """It says so, cuts them with the run, and leaves them out where one run has none."""
    run, other = (handover("truth", SENSORS, seed=seed) for seed in (1, 2))
    fields = {difference.field for difference in compare_runs(run, other)}
    assert fields == {f"measured.{name}" for name in MEASURED[2:]}  # encoders draw nothing
    without = compare_runs(run, handover("truth", {}))
    assert [difference.field for difference in without] == ["applied"]  # what acts has their values
    shorter = before(run, 50 * MS)
    assert shorter.measured is not None
    assert (len(shorter.measured.base_pose), len(shorter.measured.deputy_pose)) == (50, 3)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"common.source": "measured"}, "source is 'measured', must be 'truth' where there are no sensors"),
        (
            {"conditions.sensors.vision.latency": 0.0005},
            r"sensors\.vision\.latency is 0.0005 s, must be a multiple of the tick of 0.001 s",
        ),
        (
            {"conditions.sensors.gyro.period": 0.0015},
            r"gyro\.period is 0.0015 s, must be a multiple",
        ),
        ({"conditions.sensors.vision.dropped": 1.5}, r"dropped is 1\.5 1, must be >= 0 and <= 1"),
        ({"conditions.sensors.encoders.step": [1e-5]}, r"step is .*must be 14 numbers in rad"),
    ],
)
def test_an_error_says_what_is_wrong(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        Loop(load_scenario("smooth", values))


def test_a_snapshot_is_of_a_run_with_the_same_sensors() -> None:
    values = {"common.source": "measured", **SENSORS}
    loop = Loop(load_scenario("smooth", values))
    loop.advance_period()
    other = Loop(load_scenario("smooth", {**values, "conditions.sensors": {"gyro": {}}}))
    with pytest.raises(
        ConfigurationError, match=r"the snapshot has the sensors encoders, .*, must have gyro"
    ):
        other.restore(loop.snapshot())
