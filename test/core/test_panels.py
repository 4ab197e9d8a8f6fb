"""Panels on hinges: their frequency and decay on a free base, what is conserved, and who knows of them."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest

from sms_handover.analysis.conservation import physics_residuals
from sms_handover.frames import WORLD
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.description import load_robot
from sms_handover.model.moving_panels import with_moving_panels
from sms_handover.model.panels import Hinge, Panel
from sms_handover.model.parts import Inertia
from sms_handover.model.robot_model import RobotModel
from sms_handover.model.urdf_tree import read_urdf
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import Array, BaseWrench, read_only
from test.evidence import Record

_MASS, _BASE, _TURN = 5.0, 50.0, 8.0  # [kg], [kg], [kg m^2] of the base about x
_ROOT, _HALF = 0.5, 0.8  # [m] from the centre of the base to the hinge, and from there to the panel's centre
_STIFFNESS, _DAMPING = 30.0, 0.5  # [N m/rad], [N m s/rad]
_TICK_NS = 4_000_000
_CLOSED = "closed form of two bodies"


def _two_bodies(damping: float) -> RobotDescription:
    """Return a base with one panel, and arms that weigh next to nothing."""
    robot = load_robot()
    size = (0.4, 2 * _HALF, 0.02)
    hinge = Hinge((0.0, _ROOT, 0.0), (1.0, 0.0, 0.0), _STIFFNESS, damping)
    panel = Panel((0.0, _ROOT + _HALF, 0.0), size, _MASS, hinge)
    inertia = Inertia("base_link", _BASE, (0.0, 0.0, 0.0), (_TURN, 0.0, 0.0, 10.0, 0.0, 12.0))
    arms = tuple(
        replace(
            arm,
            links=tuple(replace(link, inertia=_faint(link.inertia)) for link in arm.links),
            gripper=replace(arm.gripper, mass=1e-9 * arm.gripper.mass),
        )
        for arm in robot.arms
    )
    return replace(robot, base=replace(robot.base, inertia=inertia, panels=(panel,)), arms=arms)


def _faint(inertia: Inertia) -> Inertia:
    moments = tuple(1e-9 * moment for moment in inertia.moments)
    return Inertia(inertia.body, 1e-9 * inertia.mass, inertia.com, moments)


def _swing(damping: float) -> tuple[FreeFloatingPlant, Array]:
    """Return the plant after 6 s in which a panel swings from a push, and its angle in every tick."""
    scenario = load_scenario("smooth", {"common.tick": 0.004})
    truth, parameters = scenario.truth, scenario.parameters
    robot = RobotModel(_two_bodies(damping))
    plant = make_plant(robot, truth.schedule, parameters.common, parameters.plant)
    plant.push(BaseWrench(0, WORLD, (0.0, 0.0, 0.0), (30.0, 0.0, 0.0)))
    angles, rest = [], read_only(np.zeros(robot.n_joints))
    for _ in range(1500):
        plant.apply(rest)
        assert plant.panels is not None
        angles.append(plant.panels.angle[0])
    return plant, np.array(angles)


def _reduced_inertia() -> float:
    """Return that of the hinge: of two bodies about a common axis, the momenta of both together zero.

    T = (mu ((h + c) w + c q')^2 + I_1 w^2 + I_2 (w + q')^2) / 2 with dT/dw = 0, mu the reduced mass.
    """
    mu, reach = _BASE * _MASS / (_BASE + _MASS), _ROOT + _HALF
    own = _MASS / 12.0 * ((2 * _HALF) ** 2 + 0.02**2)
    coupling = mu * reach * _HALF + own
    return mu * _HALF**2 + own - coupling**2 / (mu * reach**2 + _TURN + own)


def _rises(angles: Array) -> Array:
    """Return the times in s at which an angle rises through zero."""
    at = np.flatnonzero((angles[:-1] < 0.0) & (angles[1:] >= 0.0))
    return 1e-9 * _TICK_NS * (at + angles[at] / (angles[at] - angles[at + 1]))


def test_a_panel_swings_on_a_free_base_with_the_frequency_of_the_reduced_inertia(record: Record) -> None:
    """And what is conserved is conserved: momenta less the push, kinetic and elastic energy less its work."""
    plant, angles = _swing(0.0)
    period = np.diff(_rises(angles))
    assert period.size >= 3
    apart = np.abs(period / (2.0 * pi * sqrt(_reduced_inertia() / _STIFFNESS)) - 1.0).max()
    record("period of a panel on a free base, relative error", apart, 1e-4, against=_CLOSED)
    account, now, panels = plant.external_impulse, plant.conserved, plant.panels
    assert account is not None and panels is not None
    for what, gained, given, unit, bound in (  # at 4 ms; at 1 ms: below
        ("P", now.linear_momentum, account.linear_impulse, "N s", 1e-10),
        ("L", now.angular_momentum, account.angular_impulse, "N m s", 1e-11),
    ):
        apart = np.abs(gained - given).max()
        claim = f"{what} of base and panel less the push, a tick of 4 ms"
        record(claim, apart, bound, unit=unit, against="conservation")
    apart = abs((now.kinetic_energy + panels.energy) / account.work - 1.0)
    claim = "energy of base, panel and spring less the work of the push, relative"
    record(claim, apart, 1e-8, against="conservation")
    assert panels.energy > 0.0 and plant.losses == 0.0


def test_a_damper_takes_a_share_of_each_swing_and_the_energy_that_is_missing(record: Record) -> None:
    """exp(-c t / 2 I*) over a period; I* is that of the closed form."""
    plant, angles = _swing(_DAMPING)
    peaks = [angles[k] for k in range(1, angles.size - 1) if angles[k - 1] < angles[k] > angles[k + 1]]
    natural = _STIFFNESS / _reduced_inertia()
    fading = _DAMPING / (2.0 * _reduced_inertia())
    period = 2.0 * pi / sqrt(natural - fading**2)
    assert np.diff(_rises(angles)) == pytest.approx(period, rel=1e-3)
    ratios = np.divide(peaks[1:], peaks[:-1])
    apart = np.abs(ratios / exp(-fading * period) - 1.0).max()
    record("share of a swing that a damper leaves, relative error", apart, 5e-3, against=_CLOSED)
    account, panels = plant.external_impulse, plant.panels
    assert account is not None and panels is not None
    stored = plant.conserved.kinetic_energy + panels.energy
    apart = abs((stored + plant.losses) / account.work - 1.0)
    claim = "energy and heat of the damper less the work of the push, relative"
    record(claim, apart, 1e-7, against="conservation")
    assert plant.losses > 0.1 * account.work


@pytest.fixture(scope="module")
def swung() -> RunData:
    """A short run with panels towards step targets, under friction and a wrench."""
    conditions = {"rotor_inertia": 0.31, "friction": {"coulomb": 0.05, "viscous": 0.1}}
    leak = {"conditions.wrenches.leak.constant": {"force": [0, 0, 9.0], "torque": [2.0, 0, 0]}}
    values = {"common.duration": 0.2, "trajectory.time_law": "step", "conditions": conditions, **leak}
    return simulate(load_scenario("panels", values))


def test_momentum_and_energy_are_those_of_arms_and_panels_together(swung: RunData) -> None:
    residuals = physics_residuals(swung)
    assert residuals.linear_momentum < 1e-12
    assert residuals.angular_momentum < 1e-11
    assert residuals.energy < 1e-8
    assert swung.panel_names == ("panel_1_hinge", "panel_2_hinge")
    assert np.abs(swung.panel_position[-1]).min() > 1e-6
    assert swung.elastic_energy[-1] > 0.0


def test_laws_and_inverse_kinematics_know_panels_as_locked() -> None:
    """The robot that they know has the joints of the arms; locked panels weigh what swinging ones do."""
    scenario = load_scenario("panels")
    known, plain = scenario.model.robot, load_scenario("smooth").model.robot
    moving = with_moving_panels(known)
    assert known.joint_names == plain.joint_names
    assert known.mass == moving.mass == pytest.approx(plain.mass)
    assert moving.pin.nv == known.pin.nv + 2
    assert with_moving_panels(plain) is plain
    joints = {joint.name: joint for joint in read_urdf(known.urdf).joints}
    assert joints["panel_2_hinge"].is_passive and joints["panel_2_hinge"].damping == 0.209
    q = known.configuration(scenario.truth.schedule.base_in_world, np.zeros(14))
    tools = moving.tools_at(np.append(q, [0.0, 0.0]))
    for arm, pose in known.tools_at(q).items():
        assert pose.position == pytest.approx(tools[arm].position, abs=1e-14)


def test_a_snapshot_has_the_panels() -> None:
    loop = Loop(load_scenario("panels", {"common.duration": 0.1, "trajectory.time_law": "step"}))
    for _ in range(2):
        loop.advance_period()
    before = loop.snapshot()
    rest = [loop.advance_period() for _ in range(2)]
    loop.restore(before)
    again = [loop.advance_period() for _ in range(2)]
    for one, other in zip(rest, again, strict=True):
        assert one.rows.v.tobytes() == other.rows.v.tobytes()
    assert rest[-1].period is not None and rest[-1].period.panels is not None
    assert rest[-1].period.panels.angle.any()
