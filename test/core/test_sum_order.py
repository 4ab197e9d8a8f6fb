"""The sums of a tick have a fixed order, term after term, which any language can repeat bit for bit."""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.control.reference_track import ReferenceTrack
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import Array, JointReference

from .conftest import Draw


def in_order(*rows: Array) -> list[float]:
    """Return the sums of rows, entry by entry, from the first row to the last."""
    sums = rows[0].tolist()
    for row in rows[1:]:
        sums = [one + other for one, other in zip(sums, row.tolist(), strict=True)]
    return list(sums)


def test_the_desired_motion(draw: Draw) -> None:
    """q_d + s q_d' + (s^2 / 2) q_d'', and its derivatives."""
    track = ReferenceTrack()
    first, second = (JointReference(stamp, draw.vector(14), draw.vector(14)) for stamp in (0, 20_000_000))
    track.update(first)
    track.update(second)
    s, q, v, a = 0.013, second.position, second.velocity, (second.velocity - first.velocity) / 0.02
    expected = [in_order(q, s * v, 0.5 * s * s * a), in_order(v, s * a), a.tolist()]
    assert track.at(33_000_000).tolist() == expected


def test_computed_torque(robot: RobotModel, draw: Draw) -> None:
    """(q_d'' - a_1 e) - a_2 e', and H_mb H_b^-1 f_b over the six columns of H_mb."""
    torque, feedback = ComputedTorque(robot), np.array([np.full(14, 2.3), np.full(14, 3.1)])
    for _ in range(20):
        q, v, desired = draw.q(), draw.v(), np.array([draw.joints(), draw.vector(14), draw.vector(14)])
        error, rate = q[BASE_NQ:] - desired[0], v[BASE_NV:] - desired[1]
        wanted = np.concatenate([np.zeros(BASE_NV), in_order(desired[2], -2.3 * error, -3.1 * rate)])
        forces = pin.rnea(robot.pin, robot.data, q, v, wanted)
        inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
        yielding = robot.base_solver.compute(inertia[:BASE_NV, :BASE_NV]).solve(forces[:BASE_NV])
        coupled = in_order(*(inertia[BASE_NV:, k] * yielding[k] for k in range(BASE_NV)))
        assert torque(q, v, desired, feedback).tolist() == (forces[BASE_NV:] - np.array(coupled)).tolist()


@pytest.mark.parametrize("scheme", sorted(TABLEAUS))
def test_the_increment_of_a_step(robot: RobotModel, draw: Draw, scheme: str) -> None:
    """V + h b_1 a_1 + h b_2 a_2 ..., from left to right."""
    tableau, h, v = TABLEAUS[scheme], 1e-3, draw.v()
    accelerations = [draw.v(3.0) for _ in tableau.a]
    given = iter(accelerations)
    _, after = LieGroupIntegrator(robot.pin, tableau, h).step(lambda q, v: next(given), draw.q(), v)
    weights = h * np.array(tableau.b).sum(axis=0)
    assert after.tolist() == in_order(v, *(w * a for w, a in zip(weights, accelerations, strict=True)))


def test_work(scenario: Scenario, draw: Draw) -> None:
    """Joint after joint, tick after tick."""
    parameters = scenario.parameters
    plant = make_plant(scenario.truth.robot, scenario.truth.schedule, parameters.common, parameters.plant)
    work = 0.0
    for _ in range(20):
        before, effort = plant.q, draw.effort(plant.q)
        plant.apply(effort)
        for torque, way in zip(effort.tolist(), (plant.q - before)[BASE_NQ:].tolist(), strict=True):
            work += torque * way
    assert plant.work == work
