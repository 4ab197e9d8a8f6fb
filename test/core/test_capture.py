"""A deputy with mass turns freely, is captured, handed over and let go; nothing but heat goes missing."""

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.capture import capture, carried_jacobian
from sms_handover.model.conserved import ConservedQuantities, together
from sms_handover.model.poses import pose_of, pose_row, se3_of, twist_in_deputy
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.plant_state import InitialState
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import Array, GraspAction, GraspCommand, GraspStatus, Pose, Twist, read_only

from .conftest import Draw, row_distance

_EPS = np.finfo(float).eps
_MS = 1_000_000  # [ns]
_ANY: dict[str, Any] = {
    f"grasp_{kind}_tolerance": inf for kind in ("position", "angle", "speed", "rate")
}  # a grasp holds whatever is off
_FRAMES = {"one": Pose(np.array([0.0, 0.1, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))}
_STEPS = (
    GraspCommand(GraspAction.GRASP, "arm_a", "one"),
    GraspCommand(GraspAction.TRANSFER, "arm_b", "one", "arm_a"),
    GraspCommand(GraspAction.RELEASE, "arm_b"),
)


def body_of(draw: Draw, mass: float) -> pin.Inertia:
    """Return the inertia of ten random points about a random centre of mass."""
    points = draw.random.normal(size=(10, 3)) * 0.1
    spread = mass / 10.0 * points.T @ points
    return pin.Inertia(mass, draw.vector(3, 0.05), np.trace(spread) * np.eye(3) - spread)


def moving(draw: Draw, mass: float, speed: float, tick_ns: int) -> FreeFloatingPlant:
    """Return a robot in motion and a deputy that flies and tumbles beside the tool of arm A."""
    base, joints = draw.pose(), draw.joints(margin=0.5)
    deputy = draw.near(draw.robot.tools_in_world(base, joints)["arm_a"], 0.1)
    twist = Twist(draw.vector(3, speed), draw.vector(3, speed))
    initial = InitialState(base, joints, deputy, _FRAMES, twist, body_of(draw, mass))
    plant = FreeFloatingPlant(draw.robot, replace(load_parameters().plant, **_ANY), initial, tick_ns)
    plant.restore(replace(plant.snapshot(), v=read_only(draw.v(speed))))
    return plant


def twist_of_deputy(plant: FreeFloatingPlant) -> Array:
    """Return its twist (6,) about its origin in ``world`` axes."""
    return plant.deputy.twist_deputy_in_world.row


def momentum_about(conserved: ConservedQuantities, point: Array) -> Array:
    """Return L about a fixed point."""
    return conserved.angular_momentum + np.cross(conserved.centre_of_mass - point, conserved.linear_momentum)


@pytest.mark.parametrize("mass", [0.1, 4.0, 200.0])
def test_what_changes_hands_is_accounted_for(robot: RobotModel, mass: float) -> None:
    """Grasp, transfer and release in random states, with no time passing: a tick of 1 ns.

    Momenta of both together stay to 1e-12 of what is exchanged and rounding. The impulse alone says how the
    deputy moves afterwards, and that is how the hand moves. The kinetic energy that goes is the heat told.
    """
    draw = Draw(robot, seed=round(10.0 * mass))
    for _ in range(5):
        plant = moving(draw, mass, speed=1.0, tick_ns=1)
        inertia = plant.deputy_body.inertia if isinstance(plant.deputy_body, RigidDeputy) else None
        assert inertia is not None
        heat = 0.0  # [J]
        for command in _STEPS:
            before, twist, v = plant.conserved, twist_of_deputy(plant), plant.v
            turn = se3_of(plant.deputy.deputy_in_world).rotation
            (event,) = plant.execute((command,))
            assert event.status is GraspStatus.SUCCEEDED and event.energy_lost >= 0.0
            assert plant.v is v  # the state of this instant stays
            impulse = np.array(event.impulse)
            plant.apply(np.zeros(robot.n_joints))
            after = plant.conserved
            rounding = 64.0 * _EPS * np.sqrt(2.0 * (robot.mass + mass) * before.kinetic_energy)
            bound = 1e-12 * float(np.linalg.norm(impulse)) + float(rounding)
            for name in ("linear_momentum", "angular_momentum"):
                apart = getattr(after, name) - getattr(before, name)
                assert np.linalg.norm(apart) <= bound, (name, command)
            lost = before.kinetic_energy - after.kinetic_energy
            assert event.energy_lost == pytest.approx(lost, abs=1e-12 * before.kinetic_energy)
            heat += event.energy_lost
            assert plant.losses == heat
            ends = np.kron(np.eye(2), turn)
            own = ends.T @ twist + np.linalg.solve(inertia.matrix(), ends.T @ impulse)
            scale = 1.0 + np.linalg.norm(twist)
            np.testing.assert_allclose(ends @ own, twist_of_deputy(plant), rtol=0.0, atol=1e-8 * scale)


@pytest.mark.parametrize("mass", [0.1, 4.0, 200.0])
def test_a_capture_is_that_of_both_bodies_under_a_bond(robot: RobotModel, mass: float) -> None:
    """Velocities, impulse and heat against one linear system in all velocities and the impulse."""
    draw = Draw(robot, seed=5)
    for arm in robot.arms:
        q, v, twist, body = draw.q(), draw.v(), draw.vector(6), body_of(draw, mass)
        jacobian = carried_jacobian(robot, q, arm, se3_of(draw.pose(0.2)))
        found = capture(robot, q, v, jacobian, body, twist)
        joint, own = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL), body.matrix()
        none = np.zeros((v.size, BASE_NV))
        system = np.block(
            [
                [joint, none, jacobian.T],
                [none.T, own, -np.eye(BASE_NV)],
                [jacobian, -np.eye(BASE_NV), np.zeros((BASE_NV, BASE_NV))],
            ]
        )
        known = np.concatenate([joint @ v, own @ twist, np.zeros(BASE_NV)])
        after, twist_after, impulse = np.split(np.linalg.solve(system, known), [v.size, v.size + BASE_NV])
        np.testing.assert_allclose(found.velocity, after, rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(jacobian @ found.velocity, twist_after, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(found.impulse, impulse, rtol=0.0, atol=1e-11 * np.linalg.norm(impulse))
        energy = 0.5 * (v @ joint @ v + twist @ own @ twist)
        left = 0.5 * (after @ joint @ after + twist_after @ own @ twist_after)
        assert found.energy_lost == pytest.approx(energy - left, abs=1e-12 * energy)


def test_nothing_jumps_where_the_deputy_moves_with_the_hand(robot: RobotModel, draw: Draw) -> None:
    """Not by a bit, and no heat comes of it."""
    for arm in robot.arms:
        q, v, body = draw.q(), draw.v(), body_of(draw, 12.0)
        jacobian = carried_jacobian(robot, q, arm, se3_of(draw.pose(0.2)))
        found = capture(robot, q, v, jacobian, body, jacobian @ v)
        assert found.velocity.tobytes() == v.tobytes()
        assert found.energy_lost == 0.0 and not np.any(found.impulse)


def test_the_event_tells_how_deputy_and_hand_moved(robot: RobotModel, draw: Draw) -> None:
    """The relative twist is V_d - J v about the deputy's origin, in ``world`` axes."""
    plant = moving(draw, 4.0, speed=1.0, tick_ns=_MS)
    twist, v, q = twist_of_deputy(plant), plant.v, plant.q
    deputy = se3_of(plant.deputy.deputy_in_world)
    (event,) = plant.execute(_STEPS[:1])
    tool = se3_of(robot.tools_at(q)["arm_a"])
    hand = deputy.toActionMatrix() @ carried_jacobian(robot, q, "arm_a", tool.actInv(deputy)) @ v
    hand[:3] += np.cross(hand[3:], deputy.translation)  # of the origin, no longer of that of the world
    np.testing.assert_allclose(event.relative_twist, twist - hand, rtol=0.0, atol=1e-13)
    assert event.relative_rate == pytest.approx(np.linalg.norm((twist - hand)[3:]), rel=1e-12)


def test_two_commands_of_one_instant_are_carried_out_one_after_the_other(robot: RobotModel) -> None:
    """The second hand finds the deputy as the impulse of the first one has left it, as if a moment later."""
    at_once, later = (moving(Draw(robot, seed=8), 4.0, speed=1.0, tick_ns=1) for _ in range(2))
    first, second = at_once.execute(_STEPS[:2])
    (same,) = later.execute(_STEPS[:1])
    later.apply(np.zeros(robot.n_joints))
    (expected,) = later.execute(_STEPS[1:2])
    assert first == same
    for name in ("relative_twist", "impulse", "energy_lost", "relative_speed"):
        found = getattr(second, name)
        np.testing.assert_allclose(found, getattr(expected, name), rtol=0.0, atol=1e-5, err_msg=name)


def test_a_captured_deputy_is_carried_with_its_momentum(robot: RobotModel, draw: Draw) -> None:
    """A tenth of a second in each hand: momenta stay, energy is work less heat, nothing slips."""
    plant = moving(draw, 12.0, speed=0.1, tick_ns=_MS)
    start = plant.conserved
    effort = draw.effort(plant.q, 0.5)
    for command in _STEPS:
        (event,) = plant.execute((command,))
        places = []
        for _ in range(100):
            plant.apply(effort)
            held = plant.deputy.deputy_in_world  # follows the tool
            places.append(se3_of(plant.tools_in_world[command.arm]).actInv(se3_of(held)))
        now = plant.conserved
        assert now.linear_momentum == pytest.approx(start.linear_momentum, abs=1e-10)  # [kg m/s]
        centre = start.centre_of_mass
        moved = momentum_about(now, centre) - momentum_about(start, centre)
        assert moved == pytest.approx(0.0, abs=1e-10)  # [kg m^2/s]
        gained = now.kinetic_energy - start.kinetic_energy
        assert gained == pytest.approx(plant.work - plant.losses, abs=1e-10)  # [J]
        if command.action is not GraspAction.RELEASE:
            for place in places[1:]:
                assert row_distance(pose_row(pose_of(place)), pose_row(pose_of(places[0]))) < (1e-13, 1e-13)
    assert plant.losses > 0.0 and event.energy_lost == 0.0


def test_a_free_deputy_turns_as_a_symmetric_top(draw: Draw) -> None:
    """Five seconds at 60 deg/s against the closed form, its centre of mass off its origin and drifting.

    With I_t across and I_a along the axis z of symmetry, L stays, the axis goes round L at |L| / I_t, and the
    body turns about its axis besides: R(t) = exp(L t / I_t) R0 exp(z w_z (1 - I_a / I_t) t).
    """
    across, along, com = 0.16, 0.07, np.array([0.02, -0.03, 0.05])  # [kg m^2], [kg m^2], [m]
    inertia = pin.Inertia(12.0, com, np.diag([across, across, along]))
    start, rate = draw.pose(), np.deg2rad(60.0) * np.array([0.6, 0.0, 0.8])  # [rad/s] in its axes
    turn = se3_of(start).rotation
    velocity = np.array([0.02, -0.01, 0.03])  # [m/s] of the centre of mass
    linear = velocity - turn @ np.cross(rate, com)
    deputy = RigidDeputy(start, _FRAMES, inertia, 1e-3, Twist(linear, turn @ rate))
    momentum = turn @ (np.diag([across, across, along]) @ rate)
    for tick in range(1, 5001):
        deputy.drift(1e-3)
        if tick % 1000 == 0:
            t = 1e-3 * tick
            spin = np.array([0.0, 0.0, rate[2] * (1.0 - along / across) * t])
            expected = pin.exp3(momentum * t / across) @ turn @ pin.exp3(spin)
            now = se3_of(deputy.state.deputy_in_world)
            assert np.linalg.norm(pin.log3(expected.T @ now.rotation)) < 1e-12  # [rad]
            place = start.position + turn @ com + velocity * t - expected @ com
            np.testing.assert_allclose(now.translation, place, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(deputy.conserved.angular_momentum, momentum, rtol=1e-11)


def test_momenta_of_two_bodies_are_those_of_one_model_of_both(draw: Draw) -> None:
    """Two free bodies in one model of Pinocchio, which knows nothing of ours."""
    bodies, parts, masses = [body_of(draw, 3.0), body_of(draw, 7.0)], [], [3.0, 7.0]
    whole, q, v = pin.Model(), list[Array](), list[Array]()
    for number, body in enumerate(bodies):
        joint = whole.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), str(number))
        whole.appendBodyToJoint(joint, body, pin.SE3.Identity())
        pose, twist = draw.pose(), draw.vector(6)
        q.append(pose_row(pose))
        v.append(twist)
        turn = se3_of(pose).rotation
        in_world = Twist(turn @ twist[:3], turn @ twist[3:])
        parts.append(RigidDeputy(pose, _FRAMES, body, 1e-3, in_world).conserved)
    found = together(parts[0], masses[0], parts[1], masses[1])
    data = whole.createData()
    momentum = pin.computeCentroidalMomentum(whole, data, np.concatenate(q), np.concatenate(v))
    assert found.linear_momentum == pytest.approx(momentum.linear, abs=1e-13)
    assert found.angular_momentum == pytest.approx(momentum.angular, abs=1e-13)
    assert found.centre_of_mass == pytest.approx(data.com[0], abs=1e-14)
    energy = pin.computeKineticEnergy(whole, data, np.concatenate(q), np.concatenate(v))
    assert found.kinetic_energy == pytest.approx(energy, rel=1e-13)


def test_a_recorded_twist_is_in_axes_of_the_deputy(draw: Draw) -> None:
    """As Pinocchio turns it; one row and many give the same bits."""
    poses = np.array([pose_row(draw.pose()) for _ in range(20)])
    twists = draw.vector(120).reshape(20, 6)
    found = twist_in_deputy(poses, twists)
    for pose, twist, row in zip(poses, twists, found, strict=True):
        turn = pin.XYZQUATToSE3(pose).rotation.T
        np.testing.assert_allclose(row, [*(turn @ twist[:3]), *(turn @ twist[3:])], rtol=0.0, atol=8 * _EPS)
        assert twist_in_deputy(pose, twist).tobytes() == row.tobytes()
