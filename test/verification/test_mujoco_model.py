"""The same robot in MuJoCo: the two models are equal.

Two engines that share no code are given one description. At random states every quantity of the
equations of motion agrees to rounding, so what they simulate is one and the same system.
"""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from sms_handover.clearance.distances import ClearanceModel
from sms_handover.engines.mujoco_robot import MujocoRobot, rotation_matrix
from sms_handover.export.robot_files import MJCF_FILE, robot_files
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.description import load_robot
from sms_handover.model.floating_model import floating_model
from sms_handover.model.parts import Inertia, JointDescription, Origin
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose
from test.evidence import Record
from test.verification.conftest import links_in_world

_STATES = 100
_GRAZING = 1e-4  # [m] from contact, within which two engines may disagree
_TURN = (0.3, -0.5, 0.7)  # [rad] about all three axes, so that their order counts
_FAR = Pose(np.array([9.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))  # of the deputy, out of the way
_EPS = float(np.finfo(float).eps)
_ROUNDING = 10 * 12 * _EPS  # [-] ten frames in a chain, a dozen operations each
_AGAINST = f"MuJoCo {mujoco.__version__}"


def _skewed(robot: RobotDescription) -> RobotDescription:
    """Return a robot with rotors, tilted axes, turned frames and a lopsided base."""

    def turned(old: Origin) -> Origin:
        return replace(old, rpy=tuple(angle + more for angle, more in zip(old.rpy, _TURN, strict=True)))

    def joint(old: JointDescription, rotor: float) -> JointDescription:
        return replace(old, origin=turned(old.origin), axis=(0.48, -0.6, 0.64), rotor_inertia=rotor)

    arms = tuple(
        replace(
            arm,
            mount=turned(arm.mount),
            joints=tuple(joint(old, 0.1 + 0.05 * index) for index, old in enumerate(arm.joints)),
            flange=turned(arm.flange),
        )
        for arm in robot.arms
    )
    lopsided = Inertia("base_link", 200.0, (0.1, -0.2, 0.3), (30.0, 1.0, -2.0, 40.0, 3.0, 35.0))
    return replace(robot, base=replace(robot.base, inertia=lopsided), arms=arms)


@pytest.fixture(params=["shipped", "skewed"])
def description(request: pytest.FixtureRequest) -> RobotDescription:
    """The shipped robot, and one whose every number counts."""
    robot = load_robot()
    return robot if request.param == "shipped" else _skewed(robot)


def _states(robot: RobotModel) -> list[tuple[Array, Array, Array]]:
    """Return random states q, v and joint efforts."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(_STATES):
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        joints = random.uniform(robot.lower, robot.upper)
        q = np.concatenate([random.uniform(-1.0, 1.0, 3), quaternion, joints])
        v = random.uniform(-1.0, 1.0, 6 + robot.n_joints)
        found.append((q, v, random.uniform(-1.0, 1.0, robot.n_joints)))
    return found


def test_equations_of_motion_are_the_same(description: RobotDescription, record: Record) -> None:
    """Mass matrix, bias forces and acceleration; H^-1 magnifies the rounding of the last by cond(H)."""
    robot, other = RobotModel(description), MujocoRobot.of(description)
    assert other.joint_names == robot.joint_names
    largest = np.zeros(3)  # relative to the largest entry
    for q, v, effort in _states(robot):
        mass, bias, acceleration = other.dynamics(q, v, effort)
        expected_mass = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)
        expected_bias = pin.nonLinearEffects(robot.pin, robot.data, q, v)
        expected = pin.aba(robot.pin, robot.data, q, v, np.concatenate([np.zeros(6), effort]))
        pairs = ((mass, expected_mass), (bias, expected_bias), (acceleration, expected))
        errors = [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in pairs]
        errors[2] /= np.linalg.cond(expected_mass)
        largest = np.maximum(largest, errors)
    name = "shipped" if description == load_robot() else "skewed"
    record(f"mass matrix, {name} robot, relative", largest[0], _ROUNDING, against=_AGAINST)
    record(f"bias forces, {name} robot, relative", largest[1], _ROUNDING, against=_AGAINST)
    record(f"acceleration, {name} robot, relative, per cond(H)", largest[2], _ROUNDING, against=_AGAINST)


def test_every_frame_is_at_the_same_place(description: RobotDescription, record: Record) -> None:
    """Positions and rotation matrices of all links and both tools, which lie within 3 m of the base."""
    robot, other = RobotModel(description), MujocoRobot.of(description)
    position = rotation = 0.0
    for q, v, effort in _states(robot):
        other.dynamics(q, v, effort)
        for name, pose in links_in_world(robot, q).items():
            at, axes = other.frame(name)
            position = max(position, float(np.max(np.abs(at - pose.position))))
            rotation = max(rotation, float(np.max(np.abs(axes - rotation_matrix(pose.quaternion_xyzw)))))
    name = "shipped" if description == load_robot() else "skewed"
    record(f"position of links and tools, {name} robot", position, 3 * _ROUNDING, unit="m", against=_AGAINST)
    record(f"axes of links and tools, {name} robot", rotation, _ROUNDING, against=_AGAINST)


def test_momentum_is_measured_alike(description: RobotDescription, record: Record) -> None:
    """Each engine by its own formula, so that drifts measured with one hold for both."""
    robot, other = RobotModel(description), MujocoRobot.of(description)
    errors = np.zeros(2)
    for q, v, effort in _states(robot):
        other.dynamics(q, v, effort)
        conserved = conserved_quantities(robot, q, v)
        pairs = zip(other.momentum(), (conserved.linear_momentum, conserved.angular_momentum), strict=True)
        errors = np.maximum(errors, [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in pairs])
    name = "shipped" if description == load_robot() else "skewed"
    record(f"linear momentum, {name} robot, relative", errors[0], _ROUNDING, against=_AGAINST)
    # the angular momentum about the centre of mass is what is left of larger parts about the base
    record(f"angular momentum, {name} robot, relative", errors[1], 10 * _ROUNDING, against=_AGAINST)


def test_mujoco_adds_nothing(description: RobotDescription) -> None:
    """No damping, friction, spring, limit, gravity, medium, contact or balancing of inertias."""
    model = MujocoRobot.of(description).model
    for name in ("dof_damping", "dof_frictionloss", "jnt_stiffness", "jnt_limited", "body_gravcomp"):
        assert not np.any(getattr(model, name)), name
    assert not np.any(model.opt.gravity) and not np.any(model.opt.wind)
    assert (model.opt.density, model.opt.viscosity) == (0.0, 0.0)
    assert (model.ngeom, model.neq, model.ntendon) == (0, 0, 0)
    assert not np.any(model.actuator_biasprm)  # a motor without control gives no torque
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    rotors = [joint.rotor_inertia for arm in description.arms for joint in arm.joints]
    np.testing.assert_array_equal(model.dof_armature, np.concatenate([np.zeros(6), rotors]))
    parts = [description.base.inertia]
    for arm in description.arms:
        parts += [link.inertia for link in arm.links] + [arm.gripper.inertia]
    for part in parts:
        body = model.body(part.body)
        assert body.mass[0] == part.mass
        np.testing.assert_array_equal(body.ipos, part.com)
        np.testing.assert_allclose(np.sort(body.inertia), np.linalg.eigvalsh(part.matrix), rtol=10 * _EPS)


def test_the_exported_robot_is_the_same(description: RobotDescription, record: Record) -> None:
    """The MJCF of ``bag robot``, loaded as a user does: mass matrix, and which bodies touch where.

    Where no pair is nearer to contact than 0.1 mm, MuJoCo finds exactly the contacts of negative distances.
    """
    robot = RobotModel(description)
    rotors = description.rotor_inertia
    text = robot_files(robot.urdf, rotors).texts[MJCF_FILE]
    theirs = mujoco.MjModel.from_xml_string(text)
    data, mass = mujoco.MjData(theirs), np.zeros((theirs.nv, theirs.nv))
    clearance = ClearanceModel(robot.pin, robot.urdf, robot.arms, np.array([0.1, 0.34, 0.1]))
    counted = np.array([place for place, pair in enumerate(clearance.pairs) if pair[1].name != "deputy"])
    largest, compared, touched = 0.0, 0, 0
    for q, _, _ in _states(robot):
        data.qpos[:] = np.concatenate([q[:3], q[6:7], q[3:6], q[7:]])
        mujoco.mj_forward(theirs, data)
        mujoco.mj_fullM(theirs, data, mass)
        turn = np.eye(theirs.nv)
        turn[:3, :3] = rotation_matrix(q[3:7])
        expected = pin.crba(robot.pin, robot.data, q, pin.Convention.WORLD)
        largest = max(largest, np.max(np.abs(turn.T @ mass @ turn - expected)) / np.max(np.abs(expected)))
        distances = clearance.distances(q, _FAR)[counted]
        if np.min(np.abs(distances)) < _GRAZING:
            continue
        geoms = data.contact.geom[: data.ncon]
        found = {frozenset(theirs.body(theirs.geom_bodyid[geom]).name for geom in pair) for pair in geoms}
        ours = [clearance.pairs[k] for k in counted[distances < 0.0]]
        assert found == {frozenset(_link(body.name) for body in pair) for pair in ours}
        compared, touched = compared + 1, touched + bool(ours)
    assert compared > 0.9 * _STATES and touched > 0.1 * _STATES
    name = "shipped" if description == load_robot() else "skewed"
    record(f"mass matrix of the exported {name} robot, relative", largest, 1e-10, against=_AGAINST)


def test_exported_solids_are_those_of_clearance(tmp_path: Path, record: Record) -> None:
    """A box, a sphere, a capsule and a convex mesh added to the cylinders: every distance of bodies apart."""
    mesh = tmp_path / "wedge.obj"
    mesh.write_text("v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nv 0 0 0.15\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    added = {
        "arm_a_link_2": '<box size="0.3 0.1 0.2"/>',
        "arm_a_link_5": '<sphere radius="0.08"/>',
        "arm_b_link_4": '<cylinder radius="0.06" length="0.3"/>',
        "arm_b_gripper": f'<mesh filename="{mesh}" scale="1 1 2"/>',
    }
    root = ET.fromstring(RobotModel(load_robot()).urdf)
    for link in root.findall("link"):
        if shape := added.get(link.get("name", "")):
            place = '<origin xyz="0.05 -0.02 0.1" rpy="0.3 -0.5 0.7"/>'
            text = f'<collision name="added">{place}<geometry>{shape}</geometry></collision>'
            link.append(ET.fromstring(text))
            if "cylinder" in shape:
                text = '<collision_checking><capsule name="added"/></collision_checking>'
                link.append(ET.fromstring(text))
    urdf = ET.tostring(root, encoding="unicode")
    model = floating_model(urdf)
    clearance = ClearanceModel(model, urdf, ("arm_a", "arm_b"), np.array([0.1, 0.34, 0.1]))
    theirs = mujoco.MjModel.from_xml_string(robot_files(urdf).texts[MJCF_FILE])
    kinds = [int(theirs.geom_type[theirs.geom(f"{link}_2").id]) for link in added]
    names = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE)
    assert kinds == [*map(int, names), int(mujoco.mjtGeom.mjGEOM_MESH)]
    data, worst, compared = mujoco.MjData(theirs), 0.0, 0
    for q, _, _ in _states(RobotModel(load_robot()))[:20]:
        data.qpos[:] = np.concatenate([q[:3], q[6:7], q[3:6], q[7:]])
        mujoco.mj_forward(theirs, data)
        for (one, other), distance in zip(clearance.pairs, clearance.distances(q, _FAR), strict=True):
            if other.name != "deputy" and distance > 0.0:
                geoms = theirs.geom(one.name).id, theirs.geom(other.name).id
                measured = mujoco.mj_geomDistance(theirs, data, *geoms, 10.0, None)
                worst, compared = max(worst, abs(measured - distance)), compared + 1
    assert compared > 20 * 200
    record("distance of solids in the exported model", worst, 1e-5, unit="m", against=_AGAINST)


def _link(body: str) -> str:
    """Return the link of a body, of which a spacecraft has several."""
    return "base_link" if body.startswith("base_link") else body
