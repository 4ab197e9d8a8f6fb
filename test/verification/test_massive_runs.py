"""Massive deputies: whole tasks in which the deputy has mass, the law knowing it."""

import numpy as np
import pytest

from docs.mass_runs import SIZES, placed, size_of
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus
from sms_handover.units import MM_PER_M
from test.evidence import Record

_EPS = float(np.finfo(float).eps)
_LEVER = 2.0  # [m] of the farthest body from the common centre, at most


@pytest.mark.parametrize(
    ("name", "mass"), [*(("massive", mass) for mass in (1.0, 4.0, 12.0, 20.0)), ("tumbling", 12.0)]
)
def test_a_task_with_a_deputy_of_some_mass(name: str, mass: float, record: Record) -> None:
    """Both grasps, and what is conserved, over a whole run at the shipped tick.

    Rounding adds to a momentum at most ticks eps sum m|v| <= ticks eps sqrt(2 M E), and to the balance of
    energy at most so much times the largest speed of a body, taken as sqrt(2 E / m) of the deputy.
    """
    values = {"deputy.mass": mass, **placed(name, SIZES[size_of(mass)][1])} if mass != 12.0 else {}
    scenario = load_scenario(name, values)
    run = simulate(scenario)
    about = f"{name}, {mass:g} kg"
    events = run.grasp_events
    assert [event.status for event in events] == [GraspStatus.SUCCEEDED] * 2
    farthest = max(event.position_error for event in events) * MM_PER_M
    against = "a hundredth of the tolerance"
    record(f"{about}: larger distance of both grasps", farthest, 0.1, unit="mm", against=against)
    energy, whole = float(run.kinetic_energy.max()), scenario.truth.robot.mass + mass
    rounding = run.tick_ns.size * _EPS * float(np.sqrt(2.0 * whole * energy))
    for law, rows, bound, unit in (
        ("linear momentum", run.linear_momentum, rounding, "kg m/s"),
        ("angular momentum about the common centre", run.angular_momentum, _LEVER * rounding, "kg m^2/s"),
        (
            "energy less work plus heat",
            run.kinetic_energy - run.work - run.external_work + run.lost,
            rounding * float(np.sqrt(2.0 * energy / mass)),
            "J",
        ),
    ):
        departure = float(np.abs(rows - rows[0]).max())
        record(f"{law}: largest departure, {about}", departure, bound, unit=unit, against="rounding")
