"""Captures of a deputy with mass: impulse, heat and free motion against independent answers.

A momentum balance alone does not judge a grasp: also the twists of hand and deputy must agree afterwards, and
the heat be what the energies say. The answers are MuJoCo's, Lagrange multipliers over robot and deputy, and
closed forms of rigid bodies.
"""

from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from benchmarks.states import apart
from sms_handover.engines.mujoco_robot import MujocoRobot
from sms_handover.frames import DEPUTY
from sms_handover.model.capture import Capture, capture, carried_jacobian
from sms_handover.model.carrying import carrying
from sms_handover.model.conserved import ConservedQuantities, conserved_quantities, together
from sms_handover.model.description import load_robot
from sms_handover.model.mjcf import Payload as MjcfPayload
from sms_handover.model.mjcf import to_mjcf
from sms_handover.model.parts import Inertia, box_moments
from sms_handover.model.poses import pose_of
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.payload import Payload
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.types import Array, Pose, Twist
from test.evidence import Record

_EPS = float(np.finfo(float).eps)
_AGAINST = f"MuJoCo {mujoco.__version__}"
_EDGES = (0.1, 0.34, 0.1)  # [m] of a 3U CubeSat of 4 kg
_MASSES = (0.1, 4.0, 200.0)  # [kg]
_CASES = 200  # of each mass
_TICK = 1e-3  # [s]
_REACH = 3.0  # [m] between the two farthest points of robot and deputy


@dataclass(frozen=True, eq=False)
class Case:
    """A robot that moves, and a deputy that moves otherwise near the tool of an arm."""

    q: Array
    v: Array
    arm: str
    deputy: RigidDeputy


def _body(mass: float) -> Inertia:
    """Return a lopsided box, as large as a 3U CubeSat of this density would be."""
    scale = (mass / 4.0) ** (1.0 / 3.0)
    size = [scale * edge for edge in _EDGES]
    return Inertia(DEPUTY, mass, tuple(0.1 * edge for edge in size), box_moments(mass, size))


def _inertia(body: Inertia) -> pin.Inertia:
    return pin.Inertia(body.mass, np.array(body.com), np.array(body.matrix))


def _configuration(robot: RobotModel, random: np.random.Generator) -> Array:
    turn = random.normal(size=4)
    joints = random.uniform(robot.lower, robot.upper)
    return np.concatenate([random.uniform(-1.0, 1.0, 3), turn / np.linalg.norm(turn), joints])


def _tool(robot: RobotModel, q: Array, arm: str) -> tuple[Pose, pin.SE3]:
    pose = robot.tools_at(q)[arm]
    return pose, pin.XYZQUATToSE3(np.concatenate([pose.position, pose.quaternion_xyzw]))


def _case(robot: RobotModel, body: Inertia, random: np.random.Generator, speed: float = 0.1) -> Case:
    """Return random states; ``speed`` m/s and rad/s bounds every component of every velocity."""
    q, arm = _configuration(robot, random), str(random.choice(robot.arms))
    _, tool = _tool(robot, q, arm)
    place = tool * pin.SE3(pin.exp3(random.uniform(-1.0, 1.0, 3)), random.uniform(-0.2, 0.2, 3))
    twist = Twist(random.uniform(-speed, speed, 3), random.uniform(-speed, speed, 3))
    deputy = RigidDeputy(pose_of(place), {}, _inertia(body), _TICK, twist)
    return Case(q, random.uniform(-speed, speed, robot.pin.nv), arm, deputy)


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The shipped robot: 20 degrees of freedom."""
    return RobotModel(load_robot())


def _all(robot: RobotModel, payload: Payload, deputy: RigidDeputy, q: Array, v: Array) -> ConservedQuantities:
    """Return momenta and energy of robot and deputy, by the robot that carries it if one does."""
    own = conserved_quantities(payload.robot, q, v)
    if deputy.holder:
        return own
    return together(own, robot.mass, deputy.conserved, deputy.inertia.mass)


def _multipliers(robot: RobotModel, case: Case, jacobian: Array, twist: Array) -> tuple[Array, Array, Array]:
    """Return velocity of the robot, twist of the deputy and impulse by Lagrange's multipliers.

    All 26 degrees of freedom and the six conditions J v = V in one system:
    H (v+ - v) = J^T f, Y (V+ - V) = -f, J v+ = V+.
    """
    nv = robot.pin.nv
    joint = pin.crba(robot.pin, robot.data, case.q, pin.Convention.LOCAL)
    own = case.deputy.inertia.matrix()
    system = np.zeros((nv + 12, nv + 12))
    system[:nv, :nv], system[nv : nv + 6, nv : nv + 6] = joint, own
    system[:nv, nv + 6 :], system[nv : nv + 6, nv + 6 :] = -jacobian.T, np.eye(6)
    system[nv + 6 :, :nv], system[nv + 6 :, nv : nv + 6] = jacobian, -np.eye(6)
    given = np.concatenate([joint @ case.v, own @ twist, np.zeros(6)])
    found = np.linalg.solve(system, given)
    found -= np.linalg.solve(system, system @ found - given)  # one refinement
    return found[:nv], found[nv : nv + 6], found[nv + 6 :]


@pytest.mark.parametrize("mass", _MASSES)
def test_what_hands_exchange_is_conserved(robot: RobotModel, mass: float, record: Record) -> None:
    """Grasp, transfer and release: P and L of all stay, E falls by the heat, which is never negative."""
    random = np.random.default_rng(round(10 * mass))
    body, worst = _body(mass), np.zeros(3)
    for _ in range(_CASES):
        case = _case(robot, body, random)
        deputy, q, v = case.deputy, case.q, case.v
        payload = Payload(robot, deputy)
        other = next(arm for arm in robot.arms if arm != case.arm)
        for arm in (case.arm, other, ""):
            before = _all(robot, payload, deputy, q, v)
            twist = payload.twist_in_hand(q, v) if deputy.holder else deputy.twist_in_deputy
            if arm:
                deputy.attach(arm, _tool(robot, q, arm)[0])
                taken = payload.taken(q, v, twist)
                v, lost = taken.velocity, taken.energy_lost
            else:
                deputy.detach()
                payload.let_go(twist)
                lost = 0.0
            exchanged = float(np.linalg.norm((deputy.inertia.matrix() @ twist)[:3]))  # what changes hands
            after = _all(robot, payload, deputy, q, v)
            rounding = _EPS * np.sqrt(2.0 * (robot.mass + mass) * before.kinetic_energy)
            allowed = 1e-12 * exchanged + 10.0 * rounding
            linear = np.linalg.norm(after.linear_momentum - before.linear_momentum)
            angular = np.linalg.norm(after.angular_momentum - before.angular_momentum)
            heat = abs(before.kinetic_energy - after.kinetic_energy - lost)
            assert lost >= 0.0
            heat /= 1e-12 * before.kinetic_energy  # most of which a heavy deputy may turn into heat
            worst = np.maximum(worst, [linear / allowed, angular / (_REACH * allowed), heat])
    for name, value in zip(("linear momentum", "angular momentum", "heat"), worst, strict=True):
        claim = f"{name}, {3 * _CASES} changes of hands at {mass:g} kg: share of what is allowed"
        record(claim, value, 1.0, against="conservation")


@pytest.mark.parametrize("mass", _MASSES)
def test_a_grasp_is_that_of_multipliers(robot: RobotModel, mass: float, record: Record) -> None:
    """Velocity, twist of the deputy, impulse and heat, by a system that knows nothing of H + J^T Y J."""
    random = np.random.default_rng(round(10 * mass) + 1)
    body, worst = _body(mass), np.zeros(4)
    for _ in range(_CASES):
        case = _case(robot, body, random)
        jacobian, taken = _taken(robot, case)
        twist = case.deputy.twist_in_deputy
        v, deputy, impulse = _multipliers(robot, case, jacobian, twist)
        heat = 0.5 * float(impulse @ (twist - jacobian @ case.v))
        joint = pin.crba(robot.pin, robot.data, case.q, pin.Convention.LOCAL)
        condition = np.linalg.cond(joint + jacobian.T @ case.deputy.inertia.matrix() @ jacobian)
        velocity = np.max(np.abs(taken.velocity - v)) / (np.max(np.abs(v)) * condition * 10.0 * _EPS)
        twists = np.max(np.abs(jacobian @ taken.velocity - deputy))
        given = np.max(np.abs(taken.impulse + impulse)) / np.max(np.abs(impulse))
        worst = np.maximum(worst, [velocity, twists, given, abs(taken.energy_lost - heat) / heat])
    for name, value, bound, unit in (
        ("velocity of the robot, share of 10 eps cond(H)", worst[0], 1.0, "-"),
        ("twist of the deputy", worst[1], 1e-12, "m/s, rad/s"),
        ("impulse, relative", worst[2], 1e-12, "-"),
        ("heat, relative", worst[3], 1e-12, "-"),
    ):
        claim = f"{name}, {_CASES} grasps of {mass:g} kg"
        record(claim, value, bound, unit=unit, against="Lagrange multipliers, 26 dof")


def _taken(robot: RobotModel, case: Case) -> tuple[Array, Capture]:
    """Return the Jacobian of the deputy in the hand that closes on it, and what happens."""
    _, tool = _tool(robot, case.q, case.arm)
    pose = case.deputy.state.deputy_in_world
    place = pin.XYZQUATToSE3(np.concatenate([pose.position, pose.quaternion_xyzw]))
    jacobian = carried_jacobian(robot, case.q, case.arm, tool.actInv(place))
    twist = case.deputy.twist_in_deputy
    return jacobian, capture(robot, case.q, case.v, jacobian, case.deputy.inertia, twist)


def test_a_deputy_that_moves_with_the_hand_changes_nothing(robot: RobotModel) -> None:
    """Not one bit of the velocity, and no heat."""
    random = np.random.default_rng(3)
    for mass in _MASSES:
        case = _case(robot, _body(mass), random)
        jacobian, _ = _taken(robot, case)
        taken = capture(robot, case.q, case.v, jacobian, case.deputy.inertia, jacobian @ case.v)
        assert taken.velocity.tobytes() == case.v.tobytes() and taken.energy_lost == 0.0


def _stiff(robot: RobotModel, armature: float) -> RobotModel:
    """Return the robot with rotors that hardly turn."""
    stiff = copy(robot)
    stiff.pin = pin.Model(robot.pin)
    stiff.pin.armature = np.concatenate([np.zeros(BASE_NV), np.full(robot.n_joints, armature)])
    stiff.data = stiff.pin.createData()
    return stiff


def test_with_stiff_joints_two_bodies_stick(robot: RobotModel, record: Record) -> None:
    """The robot as one rigid body: the error falls as rotors grow, to rounding."""
    case = _case(robot, _body(12.0), np.random.default_rng(5))
    v = np.concatenate([case.v[:BASE_NV], np.zeros(robot.n_joints)])
    jacobian, _ = _taken(robot, case)
    own, base = case.deputy.inertia.matrix(), jacobian[:, :BASE_NV]
    rigid = pin.crba(robot.pin, robot.data, case.q, pin.Convention.LOCAL)[:BASE_NV, :BASE_NV]
    relative = case.deputy.twist_in_deputy - base @ v[:BASE_NV]
    expected = v[:BASE_NV] + np.linalg.solve(rigid + base.T @ own @ base, base.T @ own @ relative)
    errors = []
    for armature in (1e3, 1e6, 1e9, 1e12):  # kg m^2
        taken = _taken(_stiff(robot, armature), Case(case.q, v, case.arm, case.deputy))[1]
        errors.append(float(np.max(np.abs(taken.velocity[:BASE_NV] - expected))))
    for error, less in pairwise(errors[:3]):
        assert less < 2e-3 * error
    record("twist of two bodies that stick, rotors of 1e12 kg m^2", errors[-1], 1e-12, unit="m/s, rad/s",
           against="closed form")  # fmt: skip


def test_a_spin_is_shared(robot: RobotModel, record: Record) -> None:
    """A spinning deputy on a robot at rest with stiff joints: together they turn with L = I omega."""
    body, random = _body(12.0), np.random.default_rng(6)
    case = _case(robot, body, random)
    stiff = _stiff(robot, 1e15)  # kg m^2
    place = case.deputy.state.deputy_in_world
    turn = pin.Quaternion(place.quaternion_xyzw).matrix()
    spin = np.array([0.03, -0.02, 0.05])  # rad/s, in world
    still = np.cross(spin, -turn @ np.array(body.com))  # of the origin, so that the centre of mass rests
    deputy = RigidDeputy(place, {}, case.deputy.inertia, _TICK, Twist(still, spin))
    v = np.zeros(robot.pin.nv)
    _, taken = _taken(stiff, Case(case.q, v, case.arm, deputy))
    _, tool = _tool(robot, case.q, case.arm)
    held = tool.actInv(pin.XYZQUATToSE3(np.concatenate([place.position, place.quaternion_xyzw])))
    loaded = carrying(robot, case.arm, deputy.inertia, held)
    pin.ccrba(loaded.pin, loaded.data, case.q, v)
    omega = np.linalg.solve(loaded.data.Ig.inertia, deputy.conserved.angular_momentum)
    base = pin.Quaternion(case.q[3:7]).matrix()
    error = float(np.max(np.abs(base @ taken.velocity[3:BASE_NV] - omega)))
    record("spin shared by robot and deputy", error, 1e-15, unit="rad/s", against="L = I omega")


def test_a_free_deputy_is_a_symmetric_top(record: Record) -> None:
    """60 s at 60 deg/s: R(t) = exp(L t / A) R(0) exp(e_z (1 - C / A) omega_z t)."""
    across, along = 0.05, 0.02  # kg m^2
    inertia = pin.Inertia(4.0, np.zeros(3), np.diag([across, across, along]))
    omega = np.array([0.5, -0.3, 0.8])
    omega *= np.deg2rad(60.0) / np.linalg.norm(omega)
    start = pin.SE3(pin.exp3(np.array([0.4, -0.7, 0.2])), np.array([0.3, 0.1, -0.2]))
    velocity = np.array([2e-3, -1e-3, 3e-3])  # m/s
    deputy = RigidDeputy(pose_of(start), {}, inertia, _TICK, Twist(velocity, start.rotation @ omega))
    first = deputy.conserved
    steps = 60_000
    for _ in range(steps):
        deputy.drift(_TICK)
    time, last = steps * _TICK, deputy.conserved
    body = np.array([0.0, 0.0, (1.0 - along / across) * omega[2] * time])
    expected = pin.exp3(first.angular_momentum / across * time) @ start.rotation @ pin.exp3(body)
    found = deputy.state.deputy_in_world
    turned = pin.log3(expected.T @ pin.Quaternion(found.quaternion_xyzw).matrix())
    against = "symmetric top"
    record("attitude after 60 s at 60 deg/s", np.linalg.norm(turned), 1e-11, unit="rad", against=against)
    away = np.linalg.norm(found.position - start.translation - velocity * time)
    record("position after 60 s", away, 1e-11, unit="m", against="v t")
    change = np.linalg.norm(last.angular_momentum - first.angular_momentum)
    relative = change / np.linalg.norm(first.angular_momentum)
    record("angular momentum after 60 s, relative", relative, 1e-11, against="conservation")


def _held(robot: RobotModel, random: np.random.Generator) -> tuple[Case, Inertia, pin.SE3]:
    """Return a case with a deputy of 4 kg, and where the deputy is in the tool."""
    body = _body(4.0)
    case = _case(robot, body, random, speed=0.05)
    _, tool = _tool(robot, case.q, case.arm)
    pose = case.deputy.state.deputy_in_world
    place = pin.XYZQUATToSE3(np.concatenate([pose.position, pose.quaternion_xyzw]))
    return case, body, tool.actInv(place)


def test_a_carried_deputy_is_a_child_of_the_hand(robot: RobotModel, record: Record) -> None:
    """Mass matrix, and five seconds of motion after a capture, with the deputy as a body in MuJoCo's hand."""
    case, body, in_tool = _held(robot, np.random.default_rng(8))
    _, taken = _taken(robot, case)
    loaded = carrying(robot, case.arm, case.deputy.inertia, in_tool)
    payload = MjcfPayload(DEPUTY, f"{case.arm}_tool", body, pose_of(in_tool))
    other = MujocoRobot(robot.urdf, robot.description.rotor_inertia, payload)
    mass, _, _ = other.dynamics(case.q, taken.velocity, np.zeros(robot.n_joints))
    expected = pin.crba(loaded.pin, loaded.data, case.q, pin.Convention.LOCAL)
    error = np.max(np.abs(mass - expected)) / np.max(np.abs(expected))
    record("mass matrix with a deputy in the hand, relative", error, 1e-14, against=_AGAINST)
    other.place(case.q, taken.velocity)
    stepper, state = PinocchioStepper(loaded, TABLEAUS["rk4"], _TICK), (case.q, taken.velocity)
    still = np.zeros(robot.n_joints)
    for _ in range(5000):
        state = stepper.step(*state, still)
    other.drive(still)
    other.advance(_TICK, 5000)
    names = (("joints", "rad"), ("base position", "m"), ("base attitude", "rad"))
    for (name, unit), value in zip(names, apart(state, other.state), strict=True):
        record(f"{name}, 5 s after a capture", value, 1e-12, unit=unit, against=_AGAINST)


def test_a_weld_that_is_switched_on_is_the_capture(robot: RobotModel, record: Record) -> None:
    """MuJoCo's soft weld between hand and free deputy tends to the impulse as its time constant falls."""
    case, body, in_tool = _held(robot, np.random.default_rng(9))
    _, taken = _taken(robot, case)
    loaded = carrying(robot, case.arm, case.deputy.inertia, in_tool)
    step, time = 5e-5, 0.1  # [s]
    stepper, state = PinocchioStepper(loaded, TABLEAUS["rk4"], _TICK), (case.q, taken.velocity)
    for _ in range(round(time / _TICK)):
        state = stepper.step(*state, np.zeros(robot.n_joints))
    errors = []
    for constant in (4e-3, 2e-3, 1e-3):  # [s]
        model = _welded(robot, case.arm, body, in_tool, constant)
        model.opt.timestep = step
        data = _placed(model, robot, case)
        mujoco.mj_step(model, data, round(time / step))
        errors.append(float(np.max(np.abs(data.qpos[7 : 7 + robot.n_joints] - state[0][7:]))))
    orders = [float(np.log2(more / less)) for more, less in pairwise(errors)]
    claim = "order in the time constant of a weld that takes hold, distance from 1"
    record(claim, abs(orders[-1] - 1.0), 0.2, against=_AGAINST)


def _welded(robot: RobotModel, arm: str, body: Inertia, in_tool: pin.SE3, constant: float) -> mujoco.MjModel:
    """Return robot and free deputy with a weld between hand and deputy, of a time constant in s."""
    tool, place = f"{arm}_tool", pose_of(in_tool)
    carried = MjcfPayload(DEPUTY, tool, body, place)
    text = to_mjcf(robot.urdf, robot.description.rotor_inertia, limited=False, payload=carried)
    root = ET.fromstring(text)
    (hand,) = [each for each in root.iter("body") if each.get("name") == tool]
    deputy = hand[0]
    hand.remove(deputy)
    deputy.insert(0, ET.Element("freejoint"))
    root.findall("worldbody")[0].append(deputy)
    relative = [*place.position, *np.roll(place.quaternion_xyzw, 1)]
    weld = {"body1": tool, "body2": DEPUTY, "relpose": " ".join(repr(float(x)) for x in relative)}
    soft = {"solref": f"{constant} 1", "solimp": "0.9999 0.9999 0.001 0.5 2"}
    ET.SubElement(ET.SubElement(root, "equality"), "weld", weld | soft)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def _placed(model: mujoco.MjModel, robot: RobotModel, case: Case) -> mujoco.MjData:
    """Return the state of a case in MuJoCo's coordinates, robot first."""
    alone, data = MujocoRobot.of(robot.description), mujoco.MjData(model)
    alone.place(case.q, case.v)
    state = case.deputy.state
    turn = pin.Quaternion(state.deputy_in_world.quaternion_xyzw).matrix()
    place = [*state.deputy_in_world.position, *np.roll(state.deputy_in_world.quaternion_xyzw, 1)]
    twist = state.twist_deputy_in_world
    data.qpos[:] = np.concatenate([alone.data.qpos, place])
    data.qvel[:] = np.concatenate([alone.data.qvel, twist.linear, turn.T @ twist.angular])
    return data
