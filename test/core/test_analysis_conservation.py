from math import isnan, nan

import numpy as np
import pytest

from sms_handover.analysis.conservation import ik_outcomes, physics_residuals
from sms_handover.analysis.grasps import Hold, holds
from sms_handover.types import GraspAction, GraspStatus, IkStatus

from .test_analysis_runs import NS, changed, grasp, make_run


def test_the_largest_momenta_are_found_whatever_their_direction() -> None:
    run = make_run()
    linear, angular = np.zeros((2, len(run.reference_ns), 3))
    linear[100] = [3e-10, -4e-10, 0.0]
    angular[200] = [0.0, 0.0, -2e-11]
    found = physics_residuals(changed(run, linear_momentum=linear, angular_momentum=angular))
    assert found.linear_momentum == pytest.approx(5e-10)
    assert found.angular_momentum == pytest.approx(2e-11)


def test_momentum_that_came_from_outside_is_no_residual() -> None:
    run = make_run()
    given = np.outer(run.reference_ns / NS, [1.0, -2.0, 0.5])
    account = {"linear_impulse": given, "angular_impulse": 2.0 * given}
    found = physics_residuals(
        changed(run, linear_momentum=given, angular_momentum=2.0 * given + 1e-3, **account)
    )
    assert found.linear_momentum == pytest.approx(0.0, abs=1e-12)
    assert found.angular_momentum == pytest.approx(0.0, abs=1e-12)


def test_energy_without_work_is_relative_to_the_peak_energy() -> None:
    run = make_run()
    t = run.reference_ns / NS
    energy = 0.5 * np.sin(t / 60.0 * np.pi)
    found = physics_residuals(changed(run, kinetic_energy=energy, work=energy * (1.0 - 2e-6)))
    assert found.peak_kinetic_energy == pytest.approx(0.5)
    assert found.energy == pytest.approx(2e-6)


def test_only_changes_of_energy_and_work_count() -> None:
    run = make_run()
    t = run.reference_ns / NS
    found = physics_residuals(changed(run, kinetic_energy=1.0 + t, work=5.0 + t))
    assert found.energy == pytest.approx(0.0, abs=1e-12)


def test_a_run_at_rest_has_no_relative_energy() -> None:
    assert isnan(physics_residuals(make_run()).energy)


def test_values_that_were_not_recorded_are_left_out() -> None:
    run = make_run()
    rows = len(run.reference_ns)
    lost = np.full((rows, 3), nan)
    energy = np.linspace(0.0, 1.0, rows)
    work = np.array(energy)
    energy[0] = work[5] = nan
    found = physics_residuals(changed(run, linear_momentum=lost, kinetic_energy=energy, work=work))
    assert isnan(found.linear_momentum)
    assert found.energy == pytest.approx(0.0, abs=1e-12)


def test_a_solve_that_did_not_converge_is_a_failure_and_none_asked_is_no_solve() -> None:
    run = make_run()
    status = np.full(len(run.reference_ns), -1, dtype=np.int64)
    status[:10] = list(IkStatus).index(IkStatus.CONVERGED)
    status[10:13] = list(IkStatus).index(IkStatus.STALLED)
    status[13] = list(IkStatus).index(IkStatus.ITERATION_LIMIT)
    found = ik_outcomes(changed(run, ik_status=status))
    assert (found.solves, found.failures) == (14, 4)


def test_a_transfer_passes_the_deputy_on() -> None:
    events = (grasp(20.0), grasp(40.0, GraspAction.TRANSFER, "arm_b", "arm_a"))
    assert holds(events) == (Hold(20 * NS, "arm_a", ""), Hold(40 * NS, "arm_b", "arm_a"))


def test_a_release_lets_it_float() -> None:
    events = (grasp(20.0), grasp(30.0, GraspAction.RELEASE), grasp(40.0, arm="arm_b"))
    assert [(hold.holder, hold.giver) for hold in holds(events)] == [
        ("arm_a", ""),
        ("", "arm_a"),
        ("arm_b", ""),
    ]


@pytest.mark.parametrize("status", [GraspStatus.MISSED, GraspStatus.REJECTED])
def test_what_did_not_succeed_changes_nothing(status: GraspStatus) -> None:
    assert holds((grasp(20.0, status=status),)) == ()
