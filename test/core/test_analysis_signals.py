import numpy as np
import pinocchio as pin
import pytest

from sms_handover.analysis.numbers import rotation_vectors
from sms_handover.analysis.signals import (
    Signal,
    angular_momentum_change,
    base_displacement,
    base_rotation,
    base_speed,
    base_turn_rate,
    energy,
    energy_residual,
    joint_error,
    joint_torque,
    linear_momentum_change,
    orientation_error,
    position_error,
    signals_of,
)
from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData
from sms_handover.types import Array

from .test_analysis_runs import JOINTS, NS, REFERENCE_NS, TICK_NS, changed, line, make_run, poses, turns

TILTED = np.array([0.5, 0.5, 0.5, 0.5])  # turns x to y, y to z, z to x


def quaternion(rotation: Array) -> Array:
    return np.asarray(pin.Quaternion(rotation).coeffs())


def product(a: Array, b: Array) -> Array:
    return np.asarray((pin.Quaternion(a) * pin.Quaternion(b)).coeffs())


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-6, 0.3, 2.0, np.pi - 1e-6])
def test_rotation_vectors_turn_a_into_b(angle: float) -> None:
    random = np.random.default_rng(4)
    for _ in range(20):
        axis = random.standard_normal(3)
        vector = angle * axis / np.linalg.norm(axis)
        a = quaternion(pin.exp3(random.standard_normal(3)))
        half = np.append(np.sin(angle / 2) * vector / (angle or 1.0), np.cos(angle / 2))
        b = product(half, a)
        for sign in (1.0, -1.0):
            found = rotation_vectors(a, sign * b)
            assert found == pytest.approx(vector, rel=1e-9, abs=4e-16)
            turned = pin.exp3(found) @ pin.Quaternion(a).matrix()
            assert turned == pytest.approx(pin.Quaternion(b).matrix(), abs=1e-14)


def times(step_ns: int, end: float = 60.0) -> Array:
    return np.arange(0, round(end * NS) + 1, step_ns) / NS


def test_a_signal_has_a_label_per_column_and_cannot_be_written_to() -> None:
    signal = Signal("speed", "m/s", np.arange(3.0), np.zeros((3, 2)), ("left", "right"))
    for array in (signal.time, signal.values):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(
        ConfigurationError, match=r"signal 'speed' has values of shape \(3,\), they must be \(3, 1\)"
    ):
        Signal("speed", "m/s", np.arange(3.0), np.zeros(3), ("left",))


def test_the_position_error_is_tool_less_target() -> None:
    made = make_run(
        tool={"arm_a": line(lambda t: 0.1 * t, (1.0, 0.0, 0.0))},
        target={"arm_a": line(lambda t: 0.02 * t, (0.0, 0.0, 1.0))},
    )
    signal = position_error(made, "arm_a")
    t = times(REFERENCE_NS)
    assert np.array_equal(signal.time, t)
    assert signal.values == pytest.approx(np.column_stack([0.1 * t, 0.0 * t, -0.02 * t]))
    assert (signal.unit, signal.labels) == ("m", ("x", "y", "z"))
    assert np.all(position_error(made, "arm_b").values == 0.0)


def test_the_orientation_error_turns_the_target_into_the_tool_in_world_axes() -> None:
    made = make_run()
    angle = 0.01 * times(REFERENCE_NS)
    still = np.zeros((len(angle), 3))
    target = poses(still, np.tile(TILTED, (len(angle), 1)))
    tool = poses(still, np.array([product(turn, TILTED) for turn in turns(angle, (0.0, 1.0, 0.0))]))
    made = changed(
        made,
        target_pose={**made.target_pose, "arm_b": target},
        tool_pose={**made.tool_pose, "arm_b": tool},
    )
    signal = orientation_error(made, "arm_b")
    expected = np.column_stack([0.0 * angle, angle, 0.0 * angle])
    assert signal.values == pytest.approx(expected, abs=1e-15)


def test_the_joint_error_is_taken_where_the_reference_is_given() -> None:
    made = make_run()
    position = np.outer(times(TICK_NS), np.arange(1.0, 5.0))
    reference = np.outer(times(REFERENCE_NS), np.full(4, 0.5))
    signal = joint_error(changed(made, joint_position=position, reference_position=reference), "arm_b")
    assert signal.labels == JOINTS[2:]
    assert signal.values == pytest.approx(np.outer(times(REFERENCE_NS), [2.5, 3.5]))


def test_a_state_that_was_not_recorded_leaves_a_gap_in_the_joint_error() -> None:
    made = make_run(end=1.0)
    keep = made.tick_ns != 10 * REFERENCE_NS
    joints = ("joint_position", "joint_velocity", "joint_effort", "joint_command")
    per_tick = ("tick_ns", *joints, "base_pose", "base_twist")
    lossy = changed(made, **{name: getattr(made, name)[keep] for name in per_tick})
    missing = np.isnan(joint_error(lossy, "arm_a").values)
    assert np.flatnonzero(missing.any(axis=1)).tolist() == [10]


def test_torques_are_those_of_the_arm() -> None:
    made = make_run()
    effort = np.outer(times(TICK_NS), np.arange(4.0))
    signal = joint_torque(changed(made, joint_effort=effort), "arm_b")
    assert np.array_equal(signal.values, effort[:, 2:])
    assert (signal.labels, signal.unit) == (JOINTS[2:], "N m")
    assert np.array_equal(signal.time, times(TICK_NS))


def test_the_base_is_seen_from_where_it_began_in_world_axes() -> None:
    t = times(TICK_NS)
    start = quaternion(pin.exp3(np.array([0.3, -0.2, 0.9])))
    turned = np.array([product(turn, start) for turn in turns(0.02 * t, (1.0, 0.0, 0.0))])
    path = np.array([5.0, -2.0, 1.0]) + np.outer(t, [0.0, 0.1, -0.1])
    made = changed(make_run(), base_pose=poses(path, turned))
    assert base_displacement(made).values == pytest.approx(np.outer(t, [0.0, 0.1, -0.1]))
    assert base_rotation(made).values == pytest.approx(np.outer(t, [0.02, 0.0, 0.0]), abs=1e-14)


def test_the_base_is_seen_from_its_first_recorded_pose() -> None:
    path = np.outer(times(TICK_NS), [1.0, 0.0, 0.0])
    path[:3] = np.nan
    found = base_displacement(changed(make_run(), base_pose=poses(path))).values
    assert np.all(np.isnan(found[:3]))
    assert found[3:, 0] == pytest.approx(times(TICK_NS)[3:] - 0.03)


def test_speeds_are_lengths() -> None:
    twist = np.zeros((len(times(TICK_NS)), 6))
    twist[:] = (3.0, -4.0, 0.0, 0.0, 5.0, -12.0)
    made = changed(make_run(), base_twist=twist)
    assert set(base_speed(made).values.ravel()) == {5.0}
    assert set(base_turn_rate(made).values.ravel()) == {13.0}


def test_the_energy_residual_is_what_the_work_does_not_account_for() -> None:
    t = times(REFERENCE_NS)
    made = changed(make_run(), kinetic_energy=2.0 + 0.3 * t, work=7.0 + 0.1 * t)
    assert energy_residual(made).values[:, 0] == pytest.approx(0.2 * t, abs=1e-12)
    assert np.array_equal(energy(made).values, np.column_stack([2.0 + 0.3 * t, 7.0 + 0.1 * t, 0.0 * t]))


def test_heat_and_work_from_outside_are_accounted_for() -> None:
    t = times(REFERENCE_NS)
    account = {"work": 0.3 * t, "external_work": 0.1 * t, "lost": 5.0 + 0.25 * t}
    made = changed(make_run(), kinetic_energy=2.0 + 0.15 * t, **account)
    assert energy_residual(made).values == pytest.approx(0.0, abs=1e-12)
    assert energy(made).labels == ("kinetic energy", "work", "lost", "external work")
    assert np.array_equal(energy(made).values[:, 3], 0.1 * t)


def test_momenta_change_from_what_a_run_begins_with() -> None:
    t = times(REFERENCE_NS)
    held = np.column_stack([0.3 + 0.0 * t, 1e-9 * t, -4.0 + 0.0 * t])
    made = changed(make_run(), linear_momentum=held, angular_momentum=-held)
    for sign, change in ((1.0, linear_momentum_change(made)), (-1.0, angular_momentum_change(made))):
        assert np.array_equal(change.values, sign * np.column_stack([0.0 * t, 1e-9 * t, 0.0 * t]))


def test_every_signal_of_a_run_is_listed_once_per_arm() -> None:
    found = signals_of(make_run(end=1.0))
    assert list(found) == [
        *(
            f"{arm}/{name}"
            for arm in ("arm_a", "arm_b")
            for name in ("position_error", "orientation_error", "joint_error", "joint_torque")
        ),
        *("base_displacement", "base_rotation", "base_speed", "base_turn_rate"),
        *("linear_momentum", "angular_momentum", "linear_momentum_change", "angular_momentum_change"),
        *("energy", "energy_residual"),
    ]
    names = [signal.name for signal in found.values()]
    assert len(set(names)) == len(names)


def test_a_run_without_a_row_has_empty_signals() -> None:
    made = make_run(end=0.0)
    empty: dict[str, object] = {}
    for name, value in vars(made).items():
        if isinstance(value, np.ndarray):
            empty[name] = value[:0]
    empty["target_pose"] = {arm: rows[:0] for arm, rows in made.target_pose.items()}
    empty["tool_pose"] = {arm: rows[:0] for arm, rows in made.tool_pose.items()}
    none: RunData = changed(made, **empty)
    assert {signal.values.shape[0] for signal in signals_of(none).values()} == {0}
