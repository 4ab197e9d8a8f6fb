"""Wrenches from outside against closed forms, and the account of what they give."""

from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest

from sms_handover.conditions.constant_wrench import ConstantWrench
from sms_handover.conditions.orbit import GravityGradient, Orbit, RelativeOrbit
from sms_handover.conditions.thruster_misfire import ThrusterMisfire
from sms_handover.conditions.wrench import BodyAtInstant, WrenchModel
from sms_handover.conditions.wrench_history import WrenchHistory
from sms_handover.configuration.conditions_fields import BODY
from sms_handover.errors import ConfigurationError, MessageError
from sms_handover.frames import BASE, WORLD
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.base_wrenches import in_world
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance
from sms_handover.plant.external_wrenches import NO_ACCOUNT, ExternalAccount
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import Array, BaseWrench, GraspAction, GraspCommand, GraspStatus, read_only
from test.evidence import Record

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


def test_momentum_and_energy_change_by_what_wrenches_give_and_by_nothing_else(record: Record) -> None:
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
    for what, gained, given in (
        ("P", after.linear_momentum - before.linear_momentum, account.linear_impulse),
        ("L", after.angular_momentum - before.angular_momentum, account.angular_impulse),
        ("E", np.array([after.kinetic_energy - before.kinetic_energy]), np.array([account.work])),
    ):
        size = float(np.abs(given).max())
        assert size > 0.05
        apart = float(np.abs(gained - given).max()) / size
        claim = f"{what} less what six wrenches on the base gave it, relative to that"
        record(claim, apart, 1e-9, against="conservation")


_ON_DEPUTY: dict[str, dict[str, Any]] = {
    "push": {"constant": {"force": [0.3, -0.2, 0.1], "torque": [0.01, 0.02, -0.03], "point": [0.1, 0.05, 0]}},
    "turn": {"constant": {"force": [0, 0.5, 0], "torque": [0, 0, 0.02], "axes": "body"}},
    "told": {"history": {"rows": [[0, 0.1, 0, 0, 0, 0, 0.01], [1, 0, 0.3, 0, 0.02, 0, 0]]}},
    "gravity": {"gravity_gradient": {"radius": 6.778e5, "radial": [1, 0.2, 0], "normal": [0, 0, 1]}},
    "hill": {"relative_orbit": {"radius": 6.778e5, "radial": [1, 0, 0], "normal": [0, 0, 1]}},
}
_ON_BASE = {"leak": _ON_DEPUTY["push"], "hill": _ON_DEPUTY["hill"], "orbit": _ON_DEPUTY["gravity"]}


def _pushed(on_deputy: dict[str, Any], on_base: dict[str, Any], tick: float = 1e-3) -> FreeFloatingPlant:
    """Return the plant of a massive deputy that tumbles, which any tool may take from anywhere."""
    wrenches = {**{f"d_{n}": {"acts_on": "deputy", **w} for n, w in on_deputy.items()}, **on_base}
    anywhere = {f"plant.grasp_{what}_tolerance": 10.0 for what in ("position", "speed", "rate")}
    twist = {"linear": [0.01, 0.02, -0.01], "angular": [0.2, -0.1, 0.3]}
    values = {"common.tick": tick, "plant.grasp_angle_tolerance": 3.1416, **anywhere}
    deputy = {"deputy.twist_in_world": twist, "conditions.wrenches": wrenches}
    scenario = load_scenario("massive", {**values, **deputy})
    truth, parameters = scenario.truth, scenario.parameters
    return make_plant(truth.robot, truth.schedule, parameters.common, parameters.plant, truth.conditions)


def test_what_wrenches_on_deputy_and_base_give_is_accounted_for_before_and_after_a_grasp(
    record: Record,
) -> None:
    """P, L and E of both less the account stay, while it floats, in a hand, and after it was let go."""
    plant = _pushed(_ON_DEPUTY, _ON_BASE)
    effort = read_only(0.3 * np.cos(np.arange(14)))
    worst, seen = np.zeros(3), []
    before = plant.conserved
    for tick in range(90):
        if tick in (30, 60):
            action = GraspAction.GRASP if tick == 30 else GraspAction.RELEASE
            (event,) = plant.execute((GraspCommand(action, "arm_a", "end_a" if tick == 30 else ""),))
            assert event.status is GraspStatus.SUCCEEDED
        plant.apply(effort)
        now, account = plant.conserved, plant.external_impulse
        assert account is not None
        energy = now.kinetic_energy - before.kinetic_energy - plant.work + plant.losses - account.work
        worst = np.maximum(
            worst,
            [
                np.abs(now.linear_momentum - before.linear_momentum - account.linear_impulse).max(),
                np.abs(now.angular_momentum - before.angular_momentum - account.angular_impulse).max(),
                abs(energy),
            ],
        )
        seen.append(np.linalg.norm(account.linear_impulse))
    assert np.all(np.diff(seen) > 1e-5) and seen[-1] > 0.05
    for what, unit, value, bound in zip(
        "PLE", ("N s", "N m s", "J"), worst, (1e-12, 1e-11, 1e-8), strict=True
    ):
        claim = f"{what} less what eight wrenches on base and deputy gave, over grasp and release"
        record(claim, value, bound, unit=unit, against="conservation")


def test_a_deputy_that_floats_moves_under_a_constant_force_as_a_mass_point(record: Record) -> None:
    """Its centre by v t + F t^2 / 2 m; nothing moves the robot."""
    force = np.array([0.3, -0.2, 0.1])  # N
    plant = _pushed({"push": {"constant": {"force": force.tolist(), "torque": [0, 0, 0]}}}, {})
    start, robot = plant.deputy, plant.q
    for _ in range(100):
        plant.apply(read_only(np.zeros(14)))
    coasted = start.deputy_in_world.position + 0.1 * start.twist_deputy_in_world.linear
    expected = coasted + 0.5 * 0.1**2 * force / 12.0  # kg
    apart = float(np.abs(plant.deputy.deputy_in_world.position - expected).max())
    claim = "a deputy that floats under a constant force: position after 0.1 s"
    record(claim, apart, 1e-12, unit="m", against="v t + F t^2 / 2 m")
    assert np.array_equal(plant.q, robot)


def test_gravity_of_robot_and_deputy_apart_is_that_of_both_together() -> None:
    """In a hand the deputy takes its part: the force on both is that on one body, and acts on it alone."""
    hill = {"hill": _ON_DEPUTY["hill"]}
    impulses = []
    for on_deputy in ({}, hill):
        plant = _pushed(on_deputy, hill)
        plant.execute((GraspCommand(GraspAction.GRASP, "arm_a", "end_a"),))
        plant.apply(read_only(np.zeros(14)))
        assert plant.external_impulse is not None
        impulses.append((plant.external_impulse, plant.v))
    (whole, v), (apart, w) = impulses
    assert apart.linear_impulse == pytest.approx(whole.linear_impulse, rel=1e-12)
    assert not np.array_equal(v, w)


def test_a_wrench_that_is_asked_for_acts_over_the_tick_of_its_stamp_alone() -> None:
    """Its impulse is F h; ticks without one, and a plant that nobody pushes, keep their bits."""
    pushed, alone = _pushed({}, {}), _pushed({}, {})
    pushed.push(BaseWrench(3_400_000, WORLD, (40.0, 0.0, 0.0), (0.0, 3.0, 0.0)))
    given, effort = [], read_only(0.3 * np.cos(np.arange(14)))
    for tick in range(6):
        assert (pushed.v.tobytes() == alone.v.tobytes()) == (tick <= 3)
        pushed.apply(effort)
        alone.apply(effort)
        given.append(0.0 if pushed.external_impulse is None else pushed.external_impulse.linear_impulse[0])
        assert (pushed.pushed is not None) == (tick == 3)
    assert given == [0.0] * 3 + [0.04] * 3
    assert alone.effects is None and pushed.effects is not None
    with pytest.raises(MessageError, match=r"stamped 0.005 s, but the run is at 0.006 s"):
        pushed.push(BaseWrench(5_000_000, WORLD, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with pytest.raises(MessageError, match="in frame 'tool', must be 'world' or 'base_link'"):
        pushed.push(BaseWrench(9_000_000, "tool", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


def test_a_wrench_in_the_frame_of_the_base_turns_with_it() -> None:
    turn = se3_of(Draw(RobotModel(load_robot()), 4).pose()).rotation
    wrench = in_world(BaseWrench(0, BASE, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), turn)
    assert wrench.force == pytest.approx(turn @ [1.0, 2.0, 3.0])
    assert wrench.torque == pytest.approx(turn @ [4.0, 5.0, 6.0])
    assert in_world(BaseWrench(0, WORLD, (1.0, 2.0, 3.0), (0.0,) * 3), turn).force.tolist() == [1.0, 2.0, 3.0]


def test_a_snapshot_under_other_conditions_is_rejected() -> None:
    """And one of the same conditions is not, with what wrenches have given."""
    first, other = _pushed(_ON_DEPUTY, _ON_BASE), _pushed({}, _ON_BASE)
    first.apply(read_only(np.zeros(14)))
    for plant in (other, _pushed({}, {})):
        with pytest.raises(ConfigurationError, match="the snapshot is of a run under other conditions"):
            plant.restore(first.snapshot())
    with pytest.raises(ConfigurationError, match="the snapshot is of a run under other conditions"):
        first.restore(_pushed({}, {}).snapshot())
    again = _pushed(_ON_DEPUTY, _ON_BASE)
    again.restore(first.snapshot())
    for plant in (first, again):
        plant.apply(read_only(np.zeros(14)))
    assert again.v.tobytes() == first.v.tobytes()
    assert again.external_work == first.external_work != 0.0
    ideal = _pushed({}, {})
    ideal.push(BaseWrench(0, WORLD, (1.0, 0.0, 0.0), (0.0,) * 3))
    ideal.apply(read_only(np.zeros(14)))
    back = _pushed({}, {})
    back.restore(ideal.snapshot())
    assert back.external_work == ideal.external_work > 0.0


def test_a_wrench_on_a_deputy_without_mass_is_an_error_of_one_line() -> None:
    wrench: dict[str, Any] = {"conditions.wrenches.drag": {"acts_on": "deputy", **_ON_DEPUTY["push"]}}
    with pytest.raises(ConfigurationError, match="drag acts on the deputy, whose mass is 0 kg"):
        load_scenario("smooth", wrench)


@pytest.mark.parametrize("tick", [1e-3, 3e-3])
def test_a_misfire_gives_the_impulse_of_its_thruster_whatever_the_tick(tick: float, record: Record) -> None:
    robot = RobotModel(load_robot())
    misfire = ThrusterMisfire(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]), 0.0105, 0.05)
    start = (robot.configuration(Draw(robot, 1).pose(), Draw(robot, 2).joints()), np.zeros(robot.pin.nv))
    q, v, account = _moved(robot, (misfire,), start, tick, round(0.09 / tick))
    apart = abs(float(np.linalg.norm(account.linear_impulse)) / (1.0 * 0.05) - 1.0)
    claim = f"thruster misfire at a tick of {tick * 1e3:g} ms: impulse, relative error"
    record(claim, apart, 1e-10, against="F t")  # the force turns with the base, by some 1e-5 rad
    momentum = conserved_quantities(robot, q, v).linear_momentum
    assert momentum == pytest.approx(account.linear_impulse, abs=1e-14)


def test_gravity_gradient_is_that_of_the_principal_axes(record: Record) -> None:
    """3 n^2 (I_z - I_y) sin(a) cos(a) about x with the Earth at an angle a from y; none along an axis."""
    angle, orbit = 0.3, Orbit(_GEO, np.array([0.0, cos(0.3), sin(0.3)]), _X)
    torque = GravityGradient(orbit).over(0.0, 0.0, _BODY).torque
    rate = 2.0 * pi / 86164.0  # [rad/s], a sidereal day
    expected = np.array([3.0 * rate**2 * (4.0 - 2.0) * sin(angle) * cos(angle), 0.0, 0.0])
    apart = float(np.abs(torque - expected).max() / expected[0])
    record("gravity gradient in GEO, relative error", apart, 1e-4, against="principal axes, a sidereal day")
    assert not np.any(GravityGradient(Orbit(_GEO, _Y, _X)).over(0.0, 0.0, _BODY).torque)


def test_a_body_beside_the_orbit_follows_hills_equations(record: Record) -> None:
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
    apart = float(np.abs(found - above * expected).max() / above)
    claim = "a body 40 m above the orbit, after 10 min: position, share of the 40 m"
    record(claim, apart, 2e-3, against="Hill's equations")
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
