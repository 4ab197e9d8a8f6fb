"""Signed distances against closed forms, and which pairs of bodies count."""

from collections.abc import Callable
from itertools import combinations, pairwise
from unittest.mock import patch

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.errors import RobotDescriptionError
from sms_handover.model.robot_model import RobotModel
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


def test_shapes_that_cannot_be_read() -> None:
    broken = URDF.replace('<box size="0.2 0.2 0.2"/>', '<mesh filename="package://nowhere/gripper.stl"/>')
    with pytest.raises(RobotDescriptionError, match="the shapes of the robot cannot be read"):
        ClearanceModel(pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer()), broken, ["arm"], EDGES)
