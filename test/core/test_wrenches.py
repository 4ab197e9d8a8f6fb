"""Wrenches from outside against closed forms, and the account of what they give."""

from math import cos, pi, sin

import numpy as np
import pytest

from sms_handover.conditions.constant_wrench import ConstantWrench
from sms_handover.conditions.orbit import GravityGradient, Orbit, RelativeOrbit
from sms_handover.conditions.thruster_misfire import ThrusterMisfire
from sms_handover.conditions.wrench import BodyAtInstant, WrenchModel
from sms_handover.conditions.wrench_history import WrenchHistory
from sms_handover.configuration.conditions_fields import BODY
from sms_handover.errors import ConfigurationError
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance
from sms_handover.plant.external_wrenches import NO_ACCOUNT, ExternalAccount
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.types import Array

from .conftest import Draw
from .robots import someone_else

_LEO, _GEO = 6.778e6, 4.2164e7  # [m]
_X, _Y, _Z = np.eye(3)
_BODY = BodyAtInstant(np.zeros(3), np.eye(3), 5.0, np.array([0.1, 0.0, 0.0]), np.diag([1.0, 2.0, 4.0]))


def _moved(
    robot: RobotModel, models: tuple[WrenchModel, ...], start: tuple[Array, Array], tick: float, ticks: int
) -> tuple[Array, Array, ExternalAccount]:
    """Return q, v and the account after some ticks without efforts."""
    inner = PinocchioStepper(robot, TABLEAUS["rk4"], tick)
    stepper = ConditionedStepper(robot, Resistance(None, models), inner, TABLEAUS["rk4"], tick)
    (q, v), account = start, NO_ACCOUNT
    for k in range(ticks):
        stepper.begin(round(k * tick * 1e9))
        q, v = stepper.step(q, v, np.zeros(robot.n_joints))
        account = stepper.given(account)
    return q, v, account


def test_momentum_and_energy_change_by_what_wrenches_give_and_by_nothing_else() -> None:
    """P, L and E less what the account says are those of the start, with every kind of wrench at once."""
    robot = RobotModel(someone_else(load_robot(), 5))
    draw = Draw(robot, 6)
    models = (
        ConstantWrench(draw.vector(3, 20.0), draw.vector(3, 5.0), draw.vector(3), BODY),
        ConstantWrench(draw.vector(3, 20.0), draw.vector(3, 5.0), draw.vector(3)),
        ThrusterMisfire(draw.vector(3, 50.0), draw.vector(3), 0.0304, 0.0507),
        WrenchHistory(np.column_stack([[0.0, 0.05, 0.2], draw.random.normal(size=(3, 6))])),
        GravityGradient(Orbit(_LEO, _X, _Z)),
        RelativeOrbit(Orbit(_LEO, _X, _Z), draw.vector(3)),
    )
    start = (draw.q(), draw.v(0.3))
    q, v, account = _moved(robot, models, start, 1e-3, 150)
    before, after = conserved_quantities(robot, *start), conserved_quantities(robot, q, v)
    for gained, given in (
        (after.linear_momentum - before.linear_momentum, account.linear_impulse),
        (after.angular_momentum - before.angular_momentum, account.angular_impulse),
        (np.array([after.kinetic_energy - before.kinetic_energy]), np.array([account.work])),
    ):
        size = float(np.abs(given).max())
        assert size > 0.05
        assert np.abs(gained - given).max() < 1e-9 * size


@pytest.mark.parametrize("tick", [1e-3, 3e-3])
def test_a_misfire_gives_the_impulse_of_its_thruster_whatever_the_tick(tick: float) -> None:
    robot = RobotModel(load_robot())
    misfire = ThrusterMisfire(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]), 0.0105, 0.05)
    start = (robot.configuration(Draw(robot, 1).pose(), Draw(robot, 2).joints()), np.zeros(robot.pin.nv))
    q, v, account = _moved(robot, (misfire,), start, tick, round(0.09 / tick))
    assert np.linalg.norm(account.linear_impulse) == pytest.approx(1.0 * 0.05, rel=1e-12)
    momentum = conserved_quantities(robot, q, v).linear_momentum
    assert momentum == pytest.approx(account.linear_impulse, abs=1e-14)


def test_gravity_gradient_is_that_of_the_principal_axes() -> None:
    """3 n^2 (I_z - I_y) sin(a) cos(a) about x with the Earth at an angle a from y; none along an axis."""
    angle, orbit = 0.3, Orbit(_GEO, np.array([0.0, cos(0.3), sin(0.3)]), _X)
    torque = GravityGradient(orbit).over(0.0, 0.0, _BODY).torque
    rate = 2.0 * pi / 86164.0  # [rad/s], a sidereal day
    assert torque == pytest.approx(
        [3.0 * rate**2 * (4.0 - 2.0) * sin(angle) * cos(angle), 0.0, 0.0], rel=1e-4
    )
    assert not np.any(GravityGradient(Orbit(_GEO, _Y, _X)).over(0.0, 0.0, _BODY).torque)


def test_a_body_beside_the_orbit_follows_hills_equations() -> None:
    """At rest among the stars at x_0 above the orbit: x = (2 - cos nt) x_0, y = (2 sin nt - 3 nt) x_0."""
    orbit, tick, ticks, above = Orbit(_LEO, _X, _Z), 0.5, 1200, 40.0  # [s], [-], [m]
    robot = RobotModel(load_robot())
    draw = Draw(robot, 3)
    q = draw.q()
    centre = conserved_quantities(robot, q, np.zeros(robot.pin.nv)).centre_of_mass
    model = RelativeOrbit(orbit, centre - above * _X)
    q, v, _ = _moved(robot, (model,), (q, np.zeros(robot.pin.nv)), tick, ticks)
    phase = orbit.rate * tick * ticks
    radial, along = orbit.direction(tick * ticks), orbit.direction(tick * ticks + 0.5 * pi / orbit.rate)
    expected = (2.0 - cos(phase)) * radial + (2.0 * sin(phase) - 3.0 * phase) * along
    found = conserved_quantities(robot, q, v).centre_of_mass - model.reference
    assert found == pytest.approx(above * expected, abs=2e-3 * above)
    assert np.linalg.norm(found - above * _X) > 0.3 * above


def test_a_history_is_linear_between_its_rows_and_nothing_beside_them() -> None:
    history = WrenchHistory(np.array([[1.0, 0, 0, 0, 0, 0, 2.0], [3.0, 4.0, 0, 0, 0, 0, 0.0]]))
    middle = history.over(1.9, 0.2, _BODY)
    assert middle.force == pytest.approx([2.0, 0.0, 0.0])
    assert middle.torque == pytest.approx([0.0, 0.0, 1.0])
    assert not np.any(history.over(0.0, 0.1, _BODY).torque)
    with pytest.raises(ConfigurationError, match="time of row 1 is 1 s, must be > 3 s"):
        WrenchHistory(history.rows[::-1])


def test_an_orbit_needs_two_directions_at_right_angles() -> None:
    with pytest.raises(ConfigurationError, match="must be 0: they are at right angles"):
        Orbit(_GEO, _X, _X + _Y)
    with pytest.raises(ConfigurationError, match="normal is a vector of length 0"):
        Orbit(_GEO, _X, 0.0 * _X)
