from math import pi

import numpy as np
import pytest

from sms_handover.analysis.conservation import ik_outcomes, physics_residuals
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.work import joint_work
from sms_handover.run_data import RunData
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, IkStatus

from .conftest import MakeScenario
from .test_analysis_runs import JOINTS, NS, TICK_NS, changed, make_run


def driven(effort: Array, position: Array) -> RunData:
    """Return a run of which the first joint moves so under these torques."""
    run = make_run()
    efforts, positions = np.zeros((2, len(run.tick_ns), len(JOINTS)))
    efforts[:, 0], positions[:, 0] = effort, position
    return changed(run, joint_effort=efforts, joint_position=positions)


def times() -> Array:
    return np.asarray(make_run().tick_ns / NS)


def test_a_constant_torque_does_torque_times_angle() -> None:
    found = joint_work(driven(np.full(len(times()), 0.5), 0.1 * times()))
    assert found.net[0] == found.absolute[0] == pytest.approx(0.5 * 0.1 * 60.0)
    assert found.peak_power[0] == pytest.approx(0.5 * 0.1)
    assert found.net[1:].tolist() == [0.0, 0.0, 0.0]


def test_a_spring_gives_back_what_it_took() -> None:
    """Over whole swings a torque in phase with the angle does no net work, and 4 k A^2 / 2 in sizes each."""
    swing = 0.2 * np.sin(2 * pi * times())
    middle = (swing[1:] + swing[:-1]) / 2.0
    found = joint_work(driven(np.concatenate([[0.0], -3.0 * middle]), swing))
    assert found.net[0] == pytest.approx(0.0, abs=1e-12)
    assert found.absolute[0] == pytest.approx(60 * 4 * 0.5 * 3.0 * 0.2**2, rel=1e-3)


def test_phases_share_out_the_work_without_gap_or_overlap() -> None:
    run = driven(np.where(times() <= 20.0, 1.0, -3.0), 0.01 * times())
    parts = [joint_work(run, phase) for phase in phase_spans(run)]
    assert [part.net[0] for part in parts] == pytest.approx([0.2, -0.6, -0.6])
    assert [part.absolute[0] for part in parts] == pytest.approx([0.2, 0.6, 0.6])


def test_ticks_that_were_not_recorded_are_left_out() -> None:
    effort = np.full(len(times()), 2.0)
    effort[1000:2000] = np.nan
    found = joint_work(driven(effort, 0.1 * times()))
    assert found.net[0] == pytest.approx(2.0 * 0.1 * 50.0)
    lost = joint_work(driven(np.full(len(times()), np.nan), times()))
    assert np.isnan([lost.net[0], lost.absolute[0], lost.peak_power[0]]).all()


@pytest.mark.parametrize("end", [0.0, TICK_NS / NS])
def test_a_run_of_a_tick_or_none_is_no_error(end: float) -> None:
    found = joint_work(make_run(end=end))
    assert np.isnan(found.net).all() == (end == 0.0)


def test_work_per_arm_is_that_of_its_joints() -> None:
    run = driven(np.ones(len(times())), 0.1 * times())
    assert joint_work(run).of_arm("arm_a").net.tolist() == pytest.approx([6.0, 0.0])
    assert joint_work(run).of_arm("arm_b").joint_names == JOINTS[2:]


def test_the_net_work_is_what_the_plant_counted_and_what_the_energy_grew_by(
    make_scenario: MakeScenario,
) -> None:
    """Two independent counts: the plant's own sum of work, and the kinetic energy of the mass matrix."""
    run = simulate(make_scenario())
    total = joint_work(run).net.sum()
    assert total == pytest.approx(run.work[-1] - run.work[0], rel=1e-12)
    assert total == pytest.approx(run.kinetic_energy[-1] - run.kinetic_energy[0], rel=1e-6)
    parts = [joint_work(run, phase).net.sum() for phase in phase_spans(run)]
    assert sum(parts) == pytest.approx(total)


def test_residuals_of_a_phase_are_those_of_its_rows() -> None:
    run = make_run()
    t = run.reference_ns / NS
    linear, angular = np.zeros((2, len(t), 3))
    linear[:, 0] = np.where(t < 20.0, 1e-10, 3e-10)
    angular[:, 2] = 1e-12 * t
    work = 1.0 + 0.0 * t
    energy = np.where(t < 20.0, 1.0, np.where(t < 40.0, 2.0 + 1e-6 * (t - 20.0), 1.5))
    run = changed(run, linear_momentum=linear, angular_momentum=angular, kinetic_energy=energy, work=work)
    parts = [physics_residuals(run, phase) for phase in phase_spans(run)]
    assert [part.linear_momentum for part in parts] == pytest.approx([0.0, 2e-10, 2e-10], abs=1e-20)
    assert [part.angular_momentum for part in parts] == pytest.approx([19.98e-12, 39.98e-12, 60e-12])
    peak = 2.0 + 1e-6 * 19.98
    assert [part.energy for part in parts] == pytest.approx([0.0, 1e-6 * 19.98 / peak, 0.0])
    assert [part.peak_kinetic_energy for part in parts] == pytest.approx([1.0, peak, 1.5])


def test_ik_outcomes_of_phases_add_up() -> None:
    run = make_run()
    status = np.full(len(run.reference_ns), -1, dtype=np.int64)
    kinds = list(IkStatus)
    status[995:1005] = kinds.index(IkStatus.STALLED)  # five before 20 s, five from there on
    status[2100] = kinds.index(IkStatus.ITERATION_LIMIT)
    status[2500:] = kinds.index(IkStatus.CONVERGED)
    run = changed(run, ik_status=status)
    parts = [ik_outcomes(run, phase) for phase in phase_spans(run)]
    assert [(part.solves, part.failures, part.stalled, part.iteration_limit) for part in parts] == [
        (5, 5, 5, 0),
        (5, 5, 5, 0),
        (502, 1, 0, 1),
    ]
