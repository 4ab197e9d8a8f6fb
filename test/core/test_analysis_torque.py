from math import isnan, nan, pi, sqrt

import numpy as np
import pytest

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.torque import joint_torque
from sms_handover.run_data import RunData
from sms_handover.types import Array

from .test_analysis_runs import JOINTS, NS, TICK_NS, changed, make_run

TICK = TICK_NS / NS  # [s]


def with_torques(effort: Array, command: Array | None = None) -> RunData:
    """Return a run of which the first joint gives these torques; each answers the command before it."""
    run = make_run()
    efforts, commands = np.zeros((2, len(run.tick_ns), len(JOINTS)))
    efforts[:, 0] = effort
    commands[:-1, 0] = effort[1:] if command is None else command[:-1]
    return changed(run, joint_effort=efforts, joint_command=commands)


def times() -> Array:
    return np.asarray(make_run().tick_ns / NS)


def test_a_sine_has_its_peak_rms_and_effort() -> None:
    found = joint_torque(with_torques(2.0 * np.sin(2 * pi * times())))
    assert found.peak[0] == pytest.approx(2.0)
    assert found.rms[0] == pytest.approx(sqrt(2.0))
    assert found.effort[0] == pytest.approx(2.0 * 60.0)
    assert np.all(found.peak[1:] == 0.0)


def test_the_peak_counts_in_either_direction() -> None:
    effort = np.zeros(len(times()))
    effort[100] = -1.5
    assert joint_torque(with_torques(effort)).peak[0] == 1.5


def test_phases_share_out_the_effort_without_gap_or_overlap() -> None:
    run = with_torques(np.where(times() <= 20.0, 1.0, 3.0))
    parts = [joint_torque(run, phase) for phase in phase_spans(run)]
    assert [part.effort[0] for part in parts] == pytest.approx([20.0, 180.0, 180.0])
    assert [part.rms[0] for part in parts] == pytest.approx([1.0, 3.0, 3.0])
    assert sum(part.effort for part in parts) == pytest.approx(joint_torque(run).effort)


def test_a_command_that_the_plant_cuts_off_is_saturated() -> None:
    command = 5.0 * np.sin(2 * pi * times() / 60.0)
    effort = np.concatenate([[0.0], np.clip(command[:-1], -4.0, 4.0)])
    found = joint_torque(with_torques(effort, command))
    expected = int(np.sum(np.abs(command[:-1]) > 4.0))
    assert expected > 1000
    assert found.saturated_ticks.tolist() == [expected, 0, 0, 0]
    assert found.ticks_at_peak.tolist() == [expected, 0, 0, 0]
    assert found.peak[0] == 4.0


def test_saturation_is_counted_in_the_phase_where_the_torque_acts() -> None:
    command = np.where((times() >= 20.0) & (times() < 21.0), 9.0, 1.0)  # asked at 20 s, acts after it
    effort = np.concatenate([[0.0], np.clip(command[:-1], -4.0, 4.0)])
    run = with_torques(effort, command)
    counts = [int(joint_torque(run, phase).saturated_ticks[0]) for phase in phase_spans(run)]
    assert counts == [0, round(1.0 / TICK), 0]


def test_a_torque_that_its_law_limits_stays_at_its_peak() -> None:
    effort = np.clip(5.0 * np.sin(2 * pi * times() / 60.0), -4.0, 4.0)
    found = joint_torque(with_torques(effort))
    assert found.saturated_ticks[0] == 0
    assert found.ticks_at_peak[0] > 1000


def test_a_free_torque_reaches_its_peak_once() -> None:
    assert joint_torque(with_torques(np.exp(-times()) * times())).ticks_at_peak[0] == 1


def test_the_command_after_the_last_tick_never_acts() -> None:
    command = np.zeros(len(times()))
    command[-1] = 100.0
    run = with_torques(np.zeros(len(times())))
    commands = np.array(run.joint_command)
    commands[:, 0] = command
    assert joint_torque(changed(run, joint_command=commands)).saturated_ticks[0] == 0


def test_torques_that_were_not_recorded_are_left_out() -> None:
    effort = np.full(len(times()), 2.0)
    effort[1000:2000] = nan
    found = joint_torque(with_torques(effort))
    assert found.rms[0] == pytest.approx(2.0)
    assert found.effort[0] == pytest.approx(4.0 * 50.0)
    assert found.peak[0] == 2.0


@pytest.mark.parametrize("end", [0.0, 0.01])
def test_a_run_of_one_state_has_no_torques(end: float) -> None:
    run = make_run(end=end)
    for found in (joint_torque(run), joint_torque(run, phase_spans(run)[0])):
        assert isnan(found.peak[0]) == isnan(found.rms[0]) == isnan(found.effort[0]) == (end == 0.0)


def test_the_torques_of_an_arm_are_those_of_its_joints() -> None:
    run = make_run()
    efforts = np.tile([1.0, 2.0, 3.0, 4.0], (len(run.tick_ns), 1))
    found = joint_torque(changed(run, joint_effort=efforts)).of_arm("arm_b")
    assert found.joint_names == JOINTS[2:]
    assert found.peak.tolist() == [3.0, 4.0]
    assert found.ticks_at_peak.tolist() == [len(run.tick_ns) - 1] * 2


def test_an_arm_whose_name_begins_another_keeps_its_own_joints() -> None:
    assert joints_of(("arm_joint_1", "arm_b_joint_1", "arm_joint_2"), "arm") == [0, 2]


def test_arrays_are_read_only() -> None:
    found = joint_torque(make_run())
    for array in (found.peak, found.rms, found.effort, found.saturated_ticks, found.ticks_at_peak):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
