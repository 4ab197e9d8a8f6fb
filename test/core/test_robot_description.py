"""The shipped robot has the published Gen3 data, and a robot that cannot exist is refused in one line."""

import re
from collections.abc import Callable
from copy import deepcopy
from dataclasses import FrozenInstanceError, replace
from math import inf, nan, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.yaml_reader import read_yaml
from sms_handover.errors import ConfigurationError, RobotDescriptionError
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.description import load_robot
from sms_handover.model.parts import Gripper, Inertia, box_moments, cylinder_moments
from sms_handover.model.urdf import to_urdf
from sms_handover.types import Array

Document = dict[str, Any]

# Published: a pose of the Gen3 and what its URDF (angles rounded to 5 digits) gives for it.
_MENAGERIE_HOME = (0.0, 0.26179939, 3.14159265, -2.26892803, 0.0, 0.95993109, 1.57079633)  # [rad]
_ROUNDING = 1.5e-5  # [m] 7e-6 rad of tilt over 1.2 m


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """The robot as shipped."""
    return load_robot()


class Files:
    """A copy of the shipped description that a test may spoil before it is loaded."""

    def __init__(self, folder: Path) -> None:
        """Read the shipped files; ``folder`` is where the changed ones are written."""
        self.folder = folder
        self.robot: Document = deepcopy(read_yaml(config_file("robot.yaml")))
        self.arm: Document = read_yaml(config_file("gen3.yaml"))
        self.robot["arms"] = [deepcopy(arm) for arm in self.robot["arms"]]  # YAML anchors share objects

    def load(self) -> RobotDescription:
        """Write both files and load the robot from them."""
        (self.folder / "gen3.yaml").write_text(yaml.safe_dump(self.arm), encoding="utf-8")
        path = self.folder / "robot.yaml"
        path.write_text(yaml.safe_dump(self.robot), encoding="utf-8")
        return load_robot(path)


@pytest.fixture
def files(tmp_path: Path) -> Files:
    """The shipped description, to be changed."""
    return Files(tmp_path)


def _arm_model(robot: RobotDescription) -> "pin.Model":
    """Return the model with the base fixed, so that an arm can be seen alone."""
    return pin.buildModelFromXML(to_urdf(robot))


def _in_mount(robot: RobotDescription, frame: str, joints: tuple[float, ...]) -> "pin.SE3":
    """Return the pose of a frame of arm A in the frame where that arm is mounted."""
    model = _arm_model(robot)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([*joints, *[0.0] * 7]))
    mount = data.oMf[model.getFrameId("arm_a_mount")]
    return mount.actInv(data.oMf[model.getFrameId(frame)])


# --- the numbers ---------------------------------------------------------------------------------


def test_masses_sum_to_those_of_the_paper(robot: RobotDescription) -> None:
    """Seven links of 6.3549 kg and the gripper make 7 kg, and with the 240 kg body 254 kg."""
    for arm in robot.arms:
        assert sum(link.inertia.mass for link in arm.links) == pytest.approx(6.3549, abs=1e-12)
        assert arm.mass == pytest.approx(7.0, abs=1e-12)
    assert robot.base.inertia.mass == 240.0
    assert robot.mass == pytest.approx(254.0, abs=1e-9)


def test_base_is_a_uniform_cube(robot: RobotDescription) -> None:
    """240 / 12 * (1 + 1) = 40 kg m^2 about every axis, centred on base_link."""
    np.testing.assert_allclose(robot.base.inertia.matrix, 40.0 * np.eye(3), rtol=1e-15)
    assert robot.base.inertia.com == (0.0, 0.0, 0.0)


def test_every_inertia_is_that_of_a_real_body(robot: RobotDescription) -> None:
    """Principal moments are positive and obey the triangle inequality, tested with the trace form.

    The pseudo-inertia trace(I)/2 E - I is the second moment of mass, so it must be positive definite.
    """
    bodies = [robot.base.inertia]
    for arm in robot.arms:
        bodies += [link.inertia for link in arm.links] + [arm.gripper.inertia]
    assert len(bodies) == 17
    for body in bodies:
        second_moment = 0.5 * np.trace(body.matrix) * np.eye(3) - body.matrix
        assert np.linalg.eigvalsh(body.matrix).min() > 0.0, body.body
        assert np.linalg.eigvalsh(second_moment).min() > 0.0, body.body


def test_limits_are_the_published_ones(robot: RobotDescription) -> None:
    """39 and 9 N m, 1.3963 and 1.2218 rad/s, and the endless joints within two pi."""
    for arm in robot.arms:
        assert [joint.effort for joint in arm.joints] == [39.0] * 4 + [9.0] * 3
        assert [joint.velocity for joint in arm.joints] == [1.3963] * 4 + [1.2218] * 3
        upper = [2 * pi, 2.24, 2 * pi, 2.57, 2 * pi, 2.09, 2 * pi]
        assert [joint.upper for joint in arm.joints] == upper
        assert [joint.lower for joint in arm.joints] == [-value for value in upper]
        assert [joint.rotor_inertia for joint in arm.joints] == [0.0] * 7


def test_angles_are_exact_multiples_of_a_right_angle(robot: RobotDescription) -> None:
    """No rounded 3.1416 or 1.5708 of the source is left."""
    angles = [angle for arm in robot.arms for joint in arm.joints for angle in joint.origin.rpy]
    angles += [angle for arm in robot.arms for angle in (*arm.flange.rpy, *arm.mount.rpy)]
    assert set(angles) <= {0.0, pi / 2, -pi / 2, pi}


# --- kinematics and inertia against published values ---------------------------------------------


def test_flange_at_zero_is_the_sum_of_the_offsets(robot: RobotDescription) -> None:
    """With all joints at zero the arm is straight: heights add up, and so do the sideways steps."""
    flange = _in_mount(robot, "arm_a_gripper", (0.0,) * 7)
    height = 0.15643 + 0.12838 + 2 * 0.21038 + 0.20843 + 2 * 0.10593 + 0.061525
    sideways = -0.005375 - 2 * 0.006375 - 0.006375 - 2 * 0.00017505
    np.testing.assert_allclose(flange.translation, (0.0, sideways, height), atol=1e-15)
    np.testing.assert_allclose(flange.rotation, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    ("joints", "published"),
    [((0.0,) * 7, (0.0, -0.02486, 1.187385)), (_MENAGERIE_HOME, (0.456665, 0.001347, 0.433724))],
)
def test_flange_is_where_published(
    robot: RobotDescription, joints: tuple[float, ...], published: tuple[float, ...]
) -> None:
    """Forward kinematics agrees with the source's URDF to what its rounded angles allow."""
    flange = _in_mount(robot, "arm_a_gripper", joints)
    np.testing.assert_allclose(flange.translation, published, atol=_ROUNDING)


def test_tool_is_at_the_far_end_of_the_gripper(robot: RobotDescription) -> None:
    """The tool frame has the flange's axes and lies 0.12 m along the z axis that points out."""
    flange = _in_mount(robot, "arm_a_gripper", _MENAGERIE_HOME)
    tool = _in_mount(robot, "arm_a_tool", _MENAGERIE_HOME)
    offset = flange.actInv(tool)
    np.testing.assert_allclose(offset.translation, (0.0, 0.0, 0.12), atol=1e-15)
    np.testing.assert_allclose(offset.rotation, np.eye(3), atol=1e-15)
    wrist = _in_mount(robot, "arm_a_link_7", _MENAGERIE_HOME)
    assert np.dot(tool.translation - wrist.translation, tool.rotation[:, 2]) > 0.12


def test_joint_space_inertia_without_gripper_is_the_published_one(robot: RobotDescription) -> None:
    """The diagonal of H of the bare arm, which depends on every mass, centre and moment."""
    bare = replace(
        robot,
        arms=tuple(replace(arm, gripper=replace(arm.gripper, mass=1e-12)) for arm in robot.arms),
    )
    model = _arm_model(bare)
    data = model.createData()
    pin.crba(model, data, np.array([*_MENAGERIE_HOME, *[0.0] * 7]))
    published = (0.230, 0.536, 0.146, 0.206, 0.0070, 0.0093, 0.0002)
    rounding = [5e-4] * 4 + [5e-5] * 3
    assert np.all(np.abs(np.diag(data.M)[:7] - published) <= rounding)


def test_gripper_and_box_have_the_moments_of_uniform_bodies() -> None:
    """Both formulas agree with Pinocchio's own."""
    np.testing.assert_allclose(
        Inertia("cylinder", 0.6451, (0.0,) * 3, cylinder_moments(0.6451, 0.05, 0.12)).matrix,
        pin.Inertia.FromCylinder(0.6451, 0.05, 0.12).inertia,
        rtol=1e-14,
    )
    np.testing.assert_allclose(
        Inertia("box", 3.0, (0.0,) * 3, box_moments(3.0, (1.0, 2.0, 0.5))).matrix,
        pin.Inertia.FromBox(3.0, 1.0, 2.0, 0.5).inertia,
        rtol=1e-14,
    )
    assert Gripper("g", 1.0, 0.1, 0.4).inertia.com == (0.0, 0.0, 0.2)


# --- the mounts ----------------------------------------------------------------------------------


def _tools(robot: RobotDescription, joints: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the positions in base_link of both tools, both arms at the same angles."""
    model = _arm_model(robot)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([*joints, *joints]))
    a, b = (data.oMf[model.getFrameId(f"arm_{side}_tool")].translation.copy() for side in "ab")
    return a, b


def test_arms_point_out_of_the_x_face(robot: RobotDescription) -> None:
    """At zero angles the tools are straight ahead of the mounts, 0.3 m to either side."""
    a, b = _tools(robot, (0.0,) * 7)
    sideways = -0.02485010  # the arm's own offset in y, see the test of the flange
    np.testing.assert_allclose(a, (0.5 + 1.187385 + 0.12, 0.3 + sideways, 0.0), atol=1e-8)
    np.testing.assert_allclose(b, (0.5 + 1.187385 + 0.12, -0.3 + sideways, 0.0), atol=1e-8)


def test_a_bent_elbow_lifts_the_tools(robot: RobotDescription) -> None:
    """The documented roll of the mounts: negative angles of joints 2, 4, 6 move the tools to +z."""
    for number in (1, 3, 5):
        joints = [0.0] * 7
        joints[number] = -0.5
        for tool in _tools(robot, tuple(joints)):
            assert tool[2] > 0.05


# --- other robots --------------------------------------------------------------------------------


@pytest.mark.parametrize(("n_arms", "n_joints"), [(1, 1), (1, 7), (3, 4), (4, 7)])
def test_any_number_of_arms_and_joints(files: Files, n_arms: int, n_joints: int) -> None:
    """Nothing assumes two arms of seven joints."""
    files.arm["joints"] = files.arm["joints"][:n_joints]
    arm = files.robot["arms"][0]
    arm["rotor_inertia"] = [0.1] * n_joints
    files.robot["arms"] = [{**arm, "name": f"limb_{number}"} for number in range(n_arms)]
    robot = files.load()
    model = pin.buildModelFromXML(to_urdf(robot), pin.JointModelFreeFlyer())
    assert (model.nq, model.nv) == (7 + n_arms * n_joints, 6 + n_arms * n_joints)
    assert pin.computeTotalMass(model) == pytest.approx(robot.mass, abs=1e-9)
    assert [joint.rotor_inertia for joint in robot.arms[0].joints] == [0.1] * n_joints


def test_limits_can_be_overridden_per_arm(files: Files) -> None:
    """Only the limits given change, and only on the arm that gives them."""
    files.robot["arms"][1]["limits"] = {
        "joint_2": {"effort": 20},
        "joint_6": {"position": [-1.0, 1.5], "velocity": 0.5},
    }
    robot = files.load()
    shipped = load_robot()
    assert robot.arms[0] == shipped.arms[0]
    before, after = shipped.arms[1].joints, robot.arms[1].joints
    assert after[1] == replace(before[1], effort=20.0)
    assert after[5] == replace(before[5], lower=-1.0, upper=1.5, velocity=0.5)
    assert [*after[:1], *after[2:5], after[6]] == [*before[:1], *before[2:5], before[6]]


def test_base_inertia_can_be_given(files: Files) -> None:
    """Six numbers are ixx ixy ixz iyy iyz izz."""
    files.robot["base"]["inertia"] = [30.0, 1.0, 2.0, 40.0, 3.0, 50.0]
    matrix = files.load().base.inertia.matrix
    np.testing.assert_array_equal(matrix, [[30.0, 1.0, 2.0], [1.0, 40.0, 3.0], [2.0, 3.0, 50.0]])


def test_panels_and_limits_may_be_left_out(files: Files) -> None:
    """A robot without panels and overrides is a robot."""
    del files.robot["base"]["panels"]
    del files.robot["arms"][0]["limits"]
    assert files.load().base.panels == ()


def test_a_description_cannot_be_changed(robot: RobotDescription) -> None:
    """Neither its fields nor the matrices it hands out."""
    with pytest.raises(FrozenInstanceError):
        robot.base.inertia.mass = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        robot.base.inertia.matrix[0, 0] = 1.0


# --- what is refused -----------------------------------------------------------------------------

Spoil = Callable[[Files], None]


def _set(document: str, *keys: str | int, value: object) -> Spoil:
    """Return a change of one value of one file."""

    def spoil(files: Files) -> None:
        target: Any = getattr(files, document)
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = value

    return spoil


def _drop(document: str, *keys: str | int) -> Spoil:
    """Return the removal of one key of one file."""

    def spoil(files: Files) -> None:
        target: Any = getattr(files, document)
        for key in keys[:-1]:
            target = target[key]
        del target[keys[-1]]

    return spoil


def _link(key: str, value: object) -> Spoil:
    return _set("arm", "joints", 2, "link", key, value=value)


def _limit(key: str, value: object) -> Spoil:
    return _set("arm", "joints", 1, "limits", key, value=value)


def _joint(key: str, value: object) -> Spoil:
    return _set("arm", "joints", 0, key, value=value)


def _robot_arm(key: str, value: object) -> Spoil:
    return _set("robot", "arms", 0, key, value=value)


REFUSED: dict[str, tuple[Spoil, str]] = {
    "zero link mass": (_link("mass", 0.0), "joints[2].link.mass is 0.0 kg, must be > 0 kg"),
    "negative link mass": (_link("mass", -1), "joints[2].link.mass is -1 kg, must be > 0 kg"),
    "mass is text": (_link("mass", "heavy"), "joints[2].link.mass is 'heavy', must be a number in kg"),
    "mass is a boolean": (_link("mass", True), "joints[2].link.mass is True, must be a number in kg"),
    "mass beyond every float": (_link("mass", 10**400), "joints[2].link.mass is inf kg, must be finite"),
    "com not a number": (_link("com", [0.0, nan, 0.0]), "joints[2].link.com[1] is nan m, must be finite"),
    "com too short": (_link("com", [0.0, 0.0]), "joints[2].link.com is [0.0, 0.0], must be 3 numbers in m"),
    "com a number": (_link("com", 0.0), "joints[2].link.com is 0.0, must be 3 numbers in m"),
    "inertia too long": (
        _link("inertia", [1.0] * 9),
        "joints[2].link.inertia is [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, ...], must be 6 numbers in kg m^2",
    ),
    "inertia not positive definite": (
        _link("inertia", [0.01, 0.02, 0.0, 0.01, 0.0, 0.01]),
        "arm_a_link_3: inertia has principal moments -0.01, 0.01, 0.03 kg m^2, all must be > 0",
    ),
    "triangle inequality": (
        _link("inertia", [0.01, 0.0, 0.0, 0.01, 0.0, 0.0201]),
        "arm_a_link_3: inertia has principal moments 0.01, 0.01, 0.0201 kg m^2, none may exceed",
    ),
    "link radius": (_link("radius", 0.0), "joints[2].link.radius is 0.0 m, must be > 0 m"),
    "axis not of unit length": (
        _joint("axis", [0, 0, 2]),
        "arm_a_joint_1: axis [0.0, 0.0, 2.0] has length 2, must be 1",
    ),
    "axis zero": (_joint("axis", [0, 0, 0]), "arm_a_joint_1: axis [0.0, 0.0, 0.0] has length 0, must be 1"),
    "axis too long": (_joint("axis", [0, 0, 1, 0]), "joints[0].axis is [0, 0, 1, 0], must be 3 numbers"),
    "origin not a mapping": (_joint("origin", [0, 0, 0]), "joints[0].origin is [0, 0, 0], must be a mapping"),
    "origin infinite": (
        _joint("origin", {"xyz": [0, 0, inf], "rpy": [0, 0, 0]}),
        "joints[0].origin.xyz[2] is inf m, must be finite",
    ),
    "inverted limit": (
        _limit("position", [1.0, -1.0]),
        "arm_a_joint_2: position limit is [1.0, -1.0] rad, must be lower < upper",
    ),
    "empty limit": (
        _limit("position", [1.0, 1.0]),
        "arm_a_joint_2: position limit is [1.0, 1.0] rad, must be lower < upper",
    ),
    "infinite limit": (
        _limit("position", [-inf, 1.0]),
        "joints[1].limits.position[0] is -inf rad, must be finite",
    ),
    "limit with one number": (
        _limit("position", [1.0]),
        "joints[1].limits.position is [1.0], must be 2 numbers in rad",
    ),
    "zero velocity": (_limit("velocity", 0.0), "joints[1].limits.velocity is 0.0 rad/s, must be > 0 rad/s"),
    "infinite velocity": (_limit("velocity", inf), "joints[1].limits.velocity is inf rad/s, must be finite"),
    "negative effort": (_limit("effort", -39), "joints[1].limits.effort is -39 N m, must be > 0 N m"),
    "effort not a number": (_limit("effort", nan), "joints[1].limits.effort is nan N m, must be finite"),
    "unknown key in a link": (
        _link("masss", 1.0),
        "joints[2].link: unknown key 'masss' (did you mean 'mass'?): known are ",
    ),
    "unknown key in a limit": (_limit("torque", 1.0), "joints[1].limits: unknown key 'torque': known are "),
    "unknown key of the arm": (
        _set("arm", "flangee", value=0),
        "unknown key 'flangee' (did you mean 'flange'?): known are ",
    ),
    "missing link": (_drop("arm", "joints", 6, "link"), "joints[6].link is missing"),
    "missing flange": (_drop("arm", "flange"), "flange is missing"),
    "no joints": (_set("arm", "joints", value=[]), "joints has 0 entries, must be >= 1"),
    "joints not a list": (_set("arm", "joints", value={}), "joints is {}, must be a list"),
    "base mass": (_set("robot", "base", "mass", value=0), "base.mass is 0 kg, must be > 0 kg"),
    "base size": (_set("robot", "base", "size", value=[1, 0, 1]), "base.size[1] is 0 m, must be > 0 m"),
    "base inertia by an unknown name": (
        _set("robot", "base", "inertia", value="uniform_bx"),
        "base: unknown inertia 'uniform_bx' (did you mean 'uniform_box'?): known are ",
    ),
    "base inertia impossible": (
        _set("robot", "base", "inertia", value=[1, 0, 0, 1, 0, 3]),
        "base_link: inertia has principal moments 1, 1, 3 kg m^2, none may exceed the sum of the other two",
    ),
    "missing base key": (_drop("robot", "base", "com"), "base.com is missing"),
    "unknown base key": (
        _set("robot", "base", "sizes", value=1),
        "base: unknown key 'sizes' (did you mean 'size'?): known are ",
    ),
    "unknown key of the robot": (
        _set("robot", "arm", value=1),
        "unknown key 'arm' (did you mean 'arms'?): known are ",
    ),
    "key that is a number": (_set("robot", 7, value=1), "key 7 must be text"),
    "panel size": (
        _set("robot", "base", "panels", 1, "size", value=[1, 1, -1]),
        "base.panels[1].size[2] is -1 m, must be > 0 m",
    ),
    "robot without a name": (_set("robot", "name", value=""), "name is '', must be text"),
    "no arms": (_set("robot", "arms", value=[]), "the robot has 0 arms, must be >= 1"),
    "arms not a list": (_set("robot", "arms", value=None), "arms is None, must be a list"),
    "duplicate arm": (_robot_arm("name", "arm_b"), "arm name 'arm_b' is given 2 times"),
    "arm name": (
        _robot_arm("name", "Arm A"),
        "arm name is 'Arm A', must be lower-case letters, digits and _, a letter first",
    ),
    "missing mount": (_drop("robot", "arms", 0, "mount"), "arms.arm_a.mount is missing"),
    "mount angle": (
        _set("robot", "arms", 0, "mount", "rpy", value=[0, 0, nan]),
        "arms.arm_a.mount.rpy[2] is nan rad, must be finite",
    ),
    "gripper mass": (
        _set("robot", "arms", 0, "gripper", "mass", value=0),
        "arms.arm_a.gripper.mass is 0 kg, must be > 0 kg",
    ),
    "gripper length": (
        _set("robot", "arms", 0, "gripper", "length", value=-1),
        "arms.arm_a.gripper.length is -1 m, must be > 0 m",
    ),
    "gripper radius": (
        _set("robot", "arms", 0, "gripper", "radius", value=0),
        "arms.arm_a.gripper.radius is 0 m, must be > 0 m",
    ),
    "too few rotor inertias": (
        _robot_arm("rotor_inertia", [0.4] * 6),
        "arms.arm_a.rotor_inertia is [0.4, 0.4, 0.4, 0.4, 0.4, 0.4], must be 7 numbers in kg m^2",
    ),
    "negative rotor inertia": (
        _robot_arm("rotor_inertia", [0.4] * 6 + [-0.2]),
        "arm_a_joint_7: rotor inertia is -0.2 kg m^2, must be >= 0 kg m^2",
    ),
    "override of an unknown joint": (
        _robot_arm("limits", {"joint_8": {"effort": 1.0}}),
        "arms.arm_a.limits: unknown key 'joint_8' (did you mean 'joint_7'?): known are ",
    ),
    "override of an unknown limit": (
        _robot_arm("limits", {"joint_1": {"efort": 1.0}}),
        "arms.arm_a.limits.joint_1: unknown key 'efort' (did you mean 'effort'?): known are ",
    ),
    "override that inverts a limit": (
        _robot_arm("limits", {"joint_2": {"position": [1.0, -1.0]}}),
        "arm_a_joint_2: position limit is [1.0, -1.0] rad, must be lower < upper",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_impossible_robots_are_refused(files: Files, case: str) -> None:
    """The message is one line: file, line, dotted path, the value with its unit, and what is allowed."""
    spoil, expected = REFUSED[case]
    spoil(files)
    with pytest.raises(RobotDescriptionError) as caught:
        files.load()
    match = re.fullmatch(r"(.*\.yaml):(\d+): (.*)", str(caught.value))
    assert match and match[3].replace("arms.arm_a.description", "").lstrip(".: ").startswith(expected)
    lines = Path(match[1]).read_text(encoding="utf-8").splitlines()
    named = re.match(r"[\w.\[\]]*?(\w+)(\[\d+\])* is .* must be", match[3])
    assert named is None or f"{named[1]}: " in f"{lines[int(match[2]) - 1]} "


def test_missing_file_is_named(files: Files) -> None:
    """An arm whose description is not there is refused with the path looked for."""
    files.robot["arms"][0]["description"] = "gen4.yaml"
    with pytest.raises(ConfigurationError, match=r"cannot read .*gen4.yaml"):
        files.load()


def test_parts_made_in_code_are_checked_too(robot: RobotDescription) -> None:
    """The rules hold for a description however it is made."""
    arm = robot.arms[0]
    with pytest.raises(RobotDescriptionError, match=r"arm_a: has 7 joints and 6 links, must be equal"):
        replace(arm, links=arm.links[:6])
    with pytest.raises(RobotDescriptionError, match=r"arm_a: has 0 joints, must be >= 1"):
        replace(arm, joints=(), links=())
    with pytest.raises(RobotDescriptionError, match=r"arm_c: .*'arm_a_gripper', must be 'arm_c_gripper'"):
        replace(arm, name="arm_c")
    with pytest.raises(RobotDescriptionError, match=r"origin xyz is \(0.0, 0.0\), must be 3 numbers in m"):
        replace(arm.mount, xyz=(0.0, 0.0))
    with pytest.raises(RobotDescriptionError, match=r"origin rpy\[2\] is nan rad, must be finite"):
        replace(arm.mount, rpy=(0.0, 0.0, nan))
    with pytest.raises(RobotDescriptionError, match=r"arm_a_link_1: com is \(0.0, 0.0\), must be 3"):
        replace(arm.links[0].inertia, com=(0.0, 0.0))
    with pytest.raises(RobotDescriptionError, match=r"arm_a_link_1: inertia is \(.*\), must be 6"):
        replace(arm.links[0].inertia, moments=(1.0, 1.0, 1.0))
    with pytest.raises(RobotDescriptionError, match=r"arm_a_joint_1: axis is \(1.0,\), must be 3"):
        replace(arm.joints[0], axis=(1.0,))
    with pytest.raises(RobotDescriptionError, match=r"panel xyz\[0\] is inf m"):
        replace(robot.base.panels[0], xyz=(inf, 0.0, 0.0))
    with pytest.raises(RobotDescriptionError, match=r"panel size\[0\] is 0.0 m, must be > 0 m"):
        replace(robot.base.panels[0], size=(0.0, 1.0, 1.0))
    with pytest.raises(RobotDescriptionError, match=r"base_link: size\[2\] is -1.0 m, must be > 0 m"):
        replace(robot.base, size=(1.0, 1.0, -1.0))
    with pytest.raises(RobotDescriptionError, match=r"position limit\[1\] is inf rad, must be finite"):
        replace(arm.joints[0], upper=inf)


def test_a_flat_plate_is_a_real_body() -> None:
    """Equality in the triangle inequality is allowed, also after rounding."""
    third = 1.0 / 3.0
    Inertia("plate", 1.0, (0.0,) * 3, (third, 0.0, 0.0, third * sqrt(2), 0.0, third * (1 + sqrt(2))))
