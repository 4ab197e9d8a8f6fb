"""Signed distances against closed forms, and which pairs of bodies count."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.clearance.solids import MissingMeshError
from sms_handover.configuration.package_files import config_file
from sms_handover.errors import ConfigurationError, RobotDescriptionError
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.description import load_robot
from sms_handover.model.parts import Origin
from sms_handover.model.robot_model import RobotModel
from sms_handover.model.shapes import Box, Capsule, ContactPairs, Cylinder, Mesh, Shape, Sphere
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.types import Array, Pose

from .conftest import Draw

EXACT = 1e-6  # [m] of coal's iterations against closed forms
POSES = 1000
EDGES = np.array([0.3, 0.2, 0.5])  # m, of the deputy

# A ball that floats, and an arm of one joint whose gripper is a box; no two of them touch by design.
URDF = """
<robot name="ball">
  <link name="base_link">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.25"/></geometry></collision>
    <visual><geometry><sphere radius="0.25"/></geometry></visual>
    <visual><origin xyz="0 0 2"/><geometry><box size="1 1 0.1"/></geometry></visual>
  </link>
  <link name="arm_mount"/>
  <joint name="arm_mount_fixed" type="fixed"><parent link="base_link"/><child link="arm_mount"/></joint>
  <link name="arm_link_1">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="3 0 0"/><geometry><sphere radius="0.5"/></geometry></collision>
  </link>
  <joint name="arm_joint_1" type="revolute"><parent link="arm_mount"/><child link="arm_link_1"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <link name="arm_gripper">
    <collision><origin xyz="0 0 0.3"/><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  </link>
  <joint name="arm_gripper_fixed" type="fixed"><origin xyz="4 0 0"/>
    <parent link="arm_link_1"/><child link="arm_gripper"/></joint>
  <link name="arm_tool"/>
  <joint name="arm_tool_fixed" type="fixed"><parent link="arm_gripper"/><child link="arm_tool"/></joint>
</robot>"""


def ball() -> ClearanceModel:
    """The robot of :data:`URDF`."""
    return ClearanceModel(pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer()), URDF, ["arm"], EDGES)


def from_box(point: Array, half: Array) -> float:
    """Return the signed distance of a point from a box about the origin."""
    beyond = np.abs(point) - half
    return float(np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0))


def pair_of(model: ClearanceModel, *names: str) -> int:
    """Return the index of a pair by the names of its bodies."""
    (found,) = [i for i, (a, b) in enumerate(model.pairs) if {a.name, b.name} == set(names)]
    return found


@pytest.mark.parametrize(
    ("body", "centre", "radius"),
    [("base_link", (0.0, 0.0, 0.0), 0.25), ("arm_link_1", (3.0, 0.0, 0.0), 0.5)],
)
def test_distance_of_a_ball_from_the_deputy(
    draw: Draw, body: str, centre: tuple[float, ...], radius: float
) -> None:
    """The ball turns with its joint, the deputy is anywhere: outside, and inside up to its middle."""
    model = ball()
    pair = pair_of(model, body, "deputy")
    for _ in range(POSES // 2):
        base, angle = draw.pose(), draw.vector(1, 2.0)
        turn = pin.exp3(np.array([0.0, 0.0, angle[0]]))
        to_world = pin.Quaternion(base.quaternion_xyzw).matrix()
        ball_in_world = base.position + to_world @ turn @ np.array(centre)
        deputy = draw.pose()
        near = Pose(ball_in_world + draw.vector(3, 0.7), deputy.quaternion_xyzw)
        in_deputy = pin.Quaternion(near.quaternion_xyzw).matrix().T @ (ball_in_world - near.position)
        distance = model.distances(np.concatenate([base.position, base.quaternion_xyzw, angle]), near)[pair]
        assert distance == pytest.approx(from_box(in_deputy, EDGES / 2.0) - radius, abs=EXACT)
        nearest = model.nearest_points(pair)
        apart = nearest.points_in_world[1] - nearest.points_in_world[0]
        assert apart @ nearest.normal_in_world == pytest.approx(distance, abs=1e-5)


def test_distance_of_boxes_along_an_axis() -> None:
    """Gripper and deputy side by side: the gap, or how deep they are in each other."""
    model = ball()
    pair = pair_of(model, "arm_gripper", "deputy")
    q = pin.neutral(pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer()))
    gripper = np.array([4.0, 0.0, 0.3])
    reach = 0.1 + EDGES / 2.0
    for axis, gap in [(0, 0.4), (1, -0.02), (2, -0.05), (1, 1e-4)]:
        offset = np.zeros(3)
        offset[axis] = reach[axis] + gap
        distances = model.distances(q, Pose(gripper + offset, np.array([0.0, 0.0, 0.0, 1.0])))
        assert distances[pair] == pytest.approx(gap, abs=EXACT)


def test_what_is_drawn_alone_is_solid_too() -> None:
    """The panel of the ball has no collision element, as in recordings of the first edition."""
    kinds = {body.name: body.kind for body in ball().bodies}
    assert kinds == {
        "base_link": BodyKind.BASE,
        "arm_link_1": BodyKind.LINK,
        "arm_gripper": BodyKind.GRIPPER,
        "base_link_2": BodyKind.PANEL,
        "deputy": BodyKind.DEPUTY,
    }


def test_pairs_that_count(robot: RobotModel) -> None:
    """All of 22 bodies but those fixed to each other and neighbours."""
    model = ClearanceModel(robot.pin, robot.urdf, robot.arms, np.array([0.1, 0.34, 0.1]))
    counted = {frozenset((a.name, b.name)) for a, b in model.pairs}
    left_out = {frozenset(pair) for pair in combinations([body.name for body in model.bodies], 2)} - counted
    rigid = ["base_link", "base_link_2", "base_link_3", "arm_a_mount", "arm_b_mount"]
    expected = {frozenset(pair) for pair in combinations(rigid, 2)}
    for arm in robot.arms:
        chain = [f"{arm}_mount", *(f"{arm}_link_{number}" for number in range(1, 8)), f"{arm}_gripper"]
        expected |= {frozenset(pair) for pair in pairwise(chain)}
    assert left_out == expected
    assert len(model.bodies) == 22 and len(model.pairs) == 205


def test_all_distances_take_one_call(robot: RobotModel, draw: Draw) -> None:
    """The loop over the pairs is Pinocchio's; from Python each pair would cost as much as fifty."""
    model = ClearanceModel(robot.pin, robot.urdf, robot.arms, np.array([0.1, 0.34, 0.1]))
    counted: Callable[..., int]
    with patch.object(pin, "computeDistances", side_effect=pin.computeDistances) as counted:
        model.distances(draw.q(), draw.pose())
    assert counted.call_count == 1


def test_a_distance_does_not_depend_on_those_before(robot: RobotModel, draw: Draw) -> None:
    """To the last bit: a run goes on from a snapshot, and a recorded one is measured as it was online."""
    size, poses = np.array([0.1, 0.34, 0.1]), [(draw.q(), draw.pose()) for _ in range(4)]
    model = ClearanceModel(robot.pin, robot.urdf, robot.arms, size)
    for pose in poses:
        fresh = ClearanceModel(robot.pin, robot.urdf, robot.arms, size)
        assert model.distances(*pose).tobytes() == fresh.distances(*pose).tobytes()


def test_shapes_that_cannot_be_read(tmp_path: Path) -> None:
    """A mesh file that is missing is named; so is what else is wrong, each in one line."""
    model = pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer())
    box = '<box size="0.2 0.2 0.2"/>'
    for uri in ("package://nowhere/gripper.stl", "file:///nowhere/gripper.stl", "http://[nowhere"):
        broken = URDF.replace(box, f'<mesh filename="{uri}"/>')
        with pytest.raises(MissingMeshError, match=f"there is no mesh file .?{re.escape(uri)}.*$"):
            ClearanceModel(model, broken, ["arm"], EDGES)
    with pytest.raises(RobotDescriptionError, match=r"robot cannot be read: .*gripper.stl.*$"):
        file = tmp_path / "gripper.stl"
        file.write_text("solid nothing", encoding="utf-8")
        ClearanceModel(model, URDF.replace(box, f'<mesh filename="{file}"/>'), ["arm"], EDGES)


# --- what a robot file says ----------------------------------------------------------------------

CAPSULE, BALL = Capsule(0.04, 0.3), Sphere(0.2)
PLACE = Origin((0.03, -0.02, 0.1), (0.4, -0.3, 0.2))


def clearance_of(robot: RobotDescription) -> tuple[RobotModel, ClearanceModel]:
    """Return the model of a description, and its bodies with the shipped deputy."""
    model = RobotModel(robot)
    return model, ClearanceModel(model.pin, model.urdf, model.arms, np.array([0.1, 0.34, 0.1]))


def test_a_capsule_and_a_ball_in_place_of_what_is_drawn(robot: RobotModel, draw: Draw) -> None:
    """Gripper and spacecraft: the distance is that of a line from a point, less both radii."""
    shapes = {"arm_a_gripper": (Shape(CAPSULE, PLACE),), "base_link": (Shape(BALL),)}
    model, clearance = clearance_of(replace(robot.description, shapes=shapes))
    assert "base_link_2" not in [body.name for body in clearance.bodies]  # the panels are replaced too
    pair, data = pair_of(clearance, "base_link", "arm_a_gripper"), model.pin.createData()
    place = pin.SE3(pin.rpy.rpyToMatrix(*PLACE.rpy), np.array(PLACE.xyz))
    for _ in range(100):
        q = draw.q()
        distance = clearance.distances(q, draw.pose())[pair]
        pin.framesForwardKinematics(model.pin, data, q)
        middle = data.oMf[model.pin.getFrameId("arm_a_gripper")] * place
        ball = middle.actInv(data.oMf[model.pin.getFrameId("base_link")].translation)
        along = np.clip(ball[2], -CAPSULE.length / 2.0, CAPSULE.length / 2.0)
        expected = np.linalg.norm(ball - [0.0, 0.0, along]) - CAPSULE.radius - BALL.radius
        assert distance == pytest.approx(expected, abs=EXACT)


def test_a_mesh_is_its_convex_hull(robot: RobotModel, draw: Draw, tmp_path: Path) -> None:
    """A box as a mesh, twice as large by its scale, with a dent that the hull closes."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.05
    points = [*corners.tolist(), [0.0, 0.0, 0.0]]
    faces = [(1, 4, 2), (2, 4, 3), (5, 7, 6), (6, 7, 8), (1, 3, 5), (3, 7, 5), (2, 6, 4), (4, 6, 8)]
    faces += [(1, 5, 2), (2, 5, 6), (3, 4, 9), (4, 8, 9), (8, 7, 9), (7, 3, 9)]
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces]
    file = tmp_path / "dented.obj"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    mesh = Shape(Mesh(file.as_uri(), (2.0, 2.0, 2.0)), PLACE)
    as_mesh = clearance_of(replace(robot.description, shapes={"arm_b_gripper": (mesh,)}))[1]
    box = Shape(Box((0.2, 0.2, 0.2)), PLACE)
    as_box = clearance_of(replace(robot.description, shapes={"arm_b_gripper": (box,)}))[1]
    for _ in range(20):
        q, deputy = draw.q(), draw.pose()
        np.testing.assert_allclose(as_mesh.distances(q, deputy), as_box.distances(q, deputy), atol=1e-5)


def test_what_is_said_of_pairs_holds(robot: RobotModel) -> None:
    """Of a pair that would count, of neighbours, and of a gripper and the deputy."""
    contacts = ContactPairs(
        allow=(("arm_b_link_7", "arm_a_link_7"), ("arm_a_gripper", "deputy")),
        count=(("arm_a_link_2", "arm_a_link_3"),),
    )
    changed, shipped = (
        {frozenset((a.name, b.name)) for a, b in clearance_of(description)[1].pairs}
        for description in (replace(robot.description, contacts=contacts), robot.description)
    )
    allowed, counted = (set(map(frozenset, pairs)) for pairs in (contacts.allow, contacts.count))
    assert shipped - changed == allowed and changed - shipped == counted


def test_a_robot_file_gives_shapes_and_pairs(tmp_path: Path) -> None:
    """Every kind of shape, read from the file that also has the rest of the robot."""
    robot = config_file("robot.yaml").read_text(encoding="utf-8")
    robot = robot.replace("gen3.yaml", str(config_file("gen3.yaml")))
    (tmp_path / "part.stl").touch()
    path = tmp_path / "robot.yaml"
    path.write_text(robot + WITH_CLEARANCE, encoding="utf-8")
    found = load_robot(path)
    mesh = Mesh((tmp_path / "part.stl").as_uri(), (0.001, 0.001, 0.001))
    assert dict(found.shapes) == {
        "arm_a_gripper": (Shape(Capsule(0.05, 0.02), Origin((0.0, 0.0, 0.06), (0.0, 0.0, 0.0))),),
        "arm_b_link_3": (
            Shape(Sphere(0.1)),
            Shape(Box((0.1, 0.2, 0.3))),
            Shape(Cylinder(0.1, 0.2)),
            Shape(mesh),
        ),
        "base_link": (),
    }
    assert found.contacts == ContactPairs((("arm_a_link_7", "deputy"),), (("arm_a_link_2", "arm_a_link_3"),))


WITH_CLEARANCE = """
clearance:
  shapes:
    arm_a_gripper: [{capsule: {radius: 0.05, length: 0.02}, origin: {xyz: [0, 0, 0.06], rpy: [0, 0, 0]}}]
    arm_b_link_3:
      - sphere: {radius: 0.1}
      - box: [0.1, 0.2, 0.3]
      - cylinder: {radius: 0.1, length: 0.2}
      - mesh: {file: part.stl, scale: [0.001, 0.001, 0.001]}
    base_link: []
  allow: [[arm_a_link_7, deputy]]
  count: [[arm_a_link_2, arm_a_link_3]]
"""


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("shapes.gripper", [], "unknown link 'gripper'"),
        ("shapes.base_link", [{"sphere": {"radius": -1.0}}], r"sphere.radius is -1.0 m, must be > 0 m"),
        ("shapes.base_link", [{}], "a shape must have exactly one of box, cylinder, capsule, sphere, mesh"),
        ("shapes.base_link", [{"mesh": {"file": "no.stl"}}], "there is no mesh file .*no.stl"),
        (
            "shapes.base_link",
            [{"mesh": {"file": "http://[x"}}],
            r"is 'http://\[x', must be a path or a URI",
        ),
        ("allow", [["base_link"]], r"clearance.allow has \['base_link'\], must be pairs of two links"),
        ("count", 3, "clearance.count must be a list of pairs of links"),
        ("allowed", [], "unknown path 'robot.clearance.allowed' .did you mean 'robot.clearance.allow'"),
    ],
)
def test_what_a_robot_file_may_not_say_of_clearance(path: str, value: object, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as told:
        load_scenario("colliding", {f"robot.clearance.{path}": value})
    assert "\n" not in str(told.value)


def test_a_third_of_random_poses_overlap(robot: RobotModel, scenario: Scenario) -> None:
    """111 of 300 did in the measurement that made restarts look out for overlaps: here three sigma of it."""
    model = ClearanceModel(robot.pin, robot.urdf, robot.arms, scenario.truth.schedule.deputy.size)
    deputy, base, draw = (
        scenario.truth.schedule.deputy.deputy_in_world,
        scenario.truth.schedule.base_in_world,
        Draw(robot, 16),
    )
    count, share = 300, 111 / 300
    poses = (robot.configuration(base, draw.joints()) for _ in range(count))
    overlapping = sum(bool(model.distances(q, deputy).min() < 0.0) for q in poses)
    sigma = np.sqrt(2.0 * share * (1.0 - share) / count)  # of the difference of two such shares
    assert abs(overlapping / count - share) < 3.0 * sigma
