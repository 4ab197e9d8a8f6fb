"""A scene shows what was recorded: its poses are those of the model and of the run, and none is made up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.bag.recording import Recording
from sms_handover.errors import BagError, ConfigurationError, RobotDescriptionError, UnknownNameError
from sms_handover.frames import WORLD, tool_frame
from sms_handover.model.link_tree import LinkTree
from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.run_data import RunData
from sms_handover.scene.links import DescribedRobot
from sms_handover.scene.momentum import PointMass
from sms_handover.scene.recorded_scene import read_scene
from sms_handover.scene.scene import Scene, frame_stamps, make_scene
from sms_handover.scene.shapes import read_shapes
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, Pose

from .bag_messages import TYPES, open_topics, record_run
from .conftest import SCHEDULE, MakeScenario

ROUNDING = 1e-9  # m and rad; ten frames in a chain err by less than 1e-14


@pytest.fixture
def scenario(make_scenario: MakeScenario) -> Scenario:
    return make_scenario()


@pytest.fixture
def run(scenario: Scenario) -> RunData:
    """A handover of 1.4 s, so that every phase has frames of its own; the deputy drifts, as it is made to."""
    done = simulate(scenario)
    deputy_pose = done.deputy_pose.copy()
    deputy_pose[:, 0] += np.linspace(0.0, 0.1, len(deputy_pose))
    return replace(done, deputy_pose=deputy_pose)


@pytest.fixture
def scene(scenario: Scenario, run: RunData) -> Scene:
    return make_scene(run, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


def pose(row: Array) -> Pose:
    return Pose(row[:3], row[3:])


def assert_same(a: Array, b: Array) -> None:
    distance, angle = pose_distance(pose(a), pose(b))
    assert distance < ROUNDING and angle < ROUNDING


def test_every_link_is_where_the_transform_tree_puts_it(
    scene: Scene, run: RunData, robot: RobotModel
) -> None:
    """The transforms that go to /tf, multiplied along the tree by hand, give every link in the world."""
    tree = LinkTree(robot)
    for row, stamp in enumerate(scene.stamp_ns):
        tick = int(np.flatnonzero(run.tick_ns == stamp)[0])
        q = robot.configuration(pose(run.base_pose[tick]), run.joint_position[tick])
        in_world = {WORLD: se3_of(Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])))}
        moving = zip(tree.moving, map(pose, tree.moving_in_parent(q)), strict=True)
        rest = [*((parent, link, at) for (parent, link), at in moving), *tree.fixed]
        while rest:  # parents before their children
            parent, link, at = next(item for item in rest if item[0] in in_world)
            in_world[link] = in_world[parent] * se3_of(at)
            rest = [item for item in rest if item[1] != link]
        assert set(scene.links) == in_world.keys() - {WORLD}
        for place, link in enumerate(scene.links):
            distance, angle = pose_distance(pose(scene.link_in_world[row, place]), pose_of(in_world[link]))
            assert distance < ROUNDING and angle < ROUNDING, link


def test_tools_deputy_and_targets_are_the_recorded_ones(scene: Scene, run: RunData) -> None:
    rows = np.searchsorted(run.reference_ns, scene.stamp_ns)
    assert np.array_equal(run.reference_ns[rows], scene.stamp_ns)
    assert np.array_equal(scene.deputy_in_world, run.deputy_pose[rows])
    for arm in run.arms:
        assert np.array_equal(scene.target_in_world[arm], run.target_pose[arm][rows])
        for mine, recorded in zip(scene.tool(arm), run.tool_pose[arm][rows], strict=True):
            assert_same(mine, recorded)


def test_momentum_is_shown_about_the_centre_of_mass_of_all(run: RunData, scenario: Scenario) -> None:
    """Of robot and deputy by Pinocchio's inertias; where there is but rounding there is nothing to show."""
    robot, size = scenario.truth.robot, scenario.truth.schedule.deputy.size
    assert make_scene(run, robot.urdf, size).momentum is None
    angular = np.tile([0.1, -0.2, 0.3], (len(run.reference_ns), 1))
    deputy = PointMass(12.0, np.array([0.0, 0.1, 0.02]))
    scene = make_scene(replace(run, angular_momentum=angular), robot.urdf, size, deputy=deputy)
    assert scene.momentum is not None
    assert np.array_equal(scene.momentum.angular_momentum, angular[: len(scene.stamp_ns)])
    for row, stamp in enumerate(scene.stamp_ns):
        tick = int(np.searchsorted(run.tick_ns, stamp))
        q = np.concatenate([run.base_pose[tick], run.joint_position[tick]])
        alone = pin.centerOfMass(robot.pin, robot.data, q)
        held = pin.XYZQUATToSE3(scene.deputy_in_world[row]).act(np.array(deputy.com))
        expected = (robot.mass * alone + 12.0 * held) / (robot.mass + 12.0)
        np.testing.assert_allclose(scene.momentum.centre_of_mass[row], expected, rtol=0.0, atol=1e-12)


def test_a_phase_is_listed_where_it_begins(scene: Scene) -> None:
    assert [(p.name, p.stamp_ns) for p in scene.phases] == [
        ("approach", 0),
        ("carry", 400_000_000),
        ("withdraw", 1_000_000_000),
        ("let go", 1_200_000_000),
    ]


def test_joints_are_matched_by_name(run: RunData, scenario: Scenario, scene: Scene) -> None:
    turned = replace(
        run, joint_names=run.joint_names[::-1], joint_position=run.joint_position[:, ::-1].copy()
    )
    again = make_scene(turned, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)
    assert np.array_equal(again.link_in_world, scene.link_in_world)


def test_a_joint_that_the_description_lacks_is_named(run: RunData, scenario: Scenario) -> None:
    other = replace(run, joint_names=("elbow", *run.joint_names[1:]))
    with pytest.raises(UnknownNameError, match="robot description: unknown joint 'elbow'"):
        make_scene(other, scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


@pytest.mark.parametrize("frame_rate", [1.0, 25.0, 30.0, 50.0, 1000.0])
def test_frames_keep_to_the_rate_and_to_recorded_stamps(run: RunData, frame_rate: float) -> None:
    stamps = frame_stamps(run, frame_rate)
    assert set(stamps.tolist()) <= set(run.reference_ns.tolist())
    assert (stamps[0], stamps[-1]) == (run.reference_ns[0], run.reference_ns[-1])
    assert np.all(np.diff(stamps) > 0)
    period_ns = int(run.reference_ns[1] - run.reference_ns[0])
    grid = np.arange(0, stamps[-1], 1e9 / frame_rate)
    late = grid - stamps[np.searchsorted(stamps, grid + 1.0, "right") - 1]
    assert late.min() > -1.0 and late.max() < period_ns + 1.0


def test_a_gap_in_the_recording_shows_no_frame(run: RunData) -> None:
    kept = (run.reference_ns < 300_000_000) | (run.reference_ns > 700_000_000)
    stamps = frame_stamps(replace(run, reference_ns=run.reference_ns[kept].copy()), 25.0)
    assert not np.any((stamps >= 300_000_000) & (stamps <= 700_000_000))


@pytest.mark.parametrize("frame_rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_that_is_not_positive_is_refused(run: RunData, frame_rate: float) -> None:
    with pytest.raises(ConfigurationError, match=r"frame rate is .* 1/s, it must be > 0"):
        frame_stamps(run, frame_rate)


def test_a_run_without_references_is_refused(run: RunData) -> None:
    with pytest.raises(ConfigurationError, match="nothing to show"):
        frame_stamps(replace(run, reference_ns=run.reference_ns[:0].copy()), 25.0)


def test_the_scene_of_a_bag_is_that_of_the_run(
    tmp_path: Path, run: RunData, scene: Scene, scenario: Scenario
) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        record_run(recording, run)
        recording.describe(urdf=scenario.truth.robot.urdf, schedule=SCHEDULE)
    again = read_scene(tmp_path / "bag")
    assert (again.links, again.arms, again.phases) == (scene.links, scene.arms, scene.phases)
    for name in ("stamp_ns", "link_in_world", "deputy_size", "deputy_in_world"):
        assert np.array_equal(getattr(again, name), getattr(scene, name)), name


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "carries no robot description"),
        ({"urdf": True}, "carries no schedule"),
        ({"urdf": True, "schedule": "deputy: {size: [0.1, -0.3, 0.1]}"}, r"deputy\.size.*m"),
    ],
)
def test_a_bag_that_lacks_something_says_what(
    tmp_path: Path, run: RunData, scenario: Scenario, given: dict[str, object], message: str
) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        record_run(recording, run)
        urdf = scenario.truth.robot.urdf if given.get("urdf") else None
        recording.describe(urdf=urdf, schedule=given.get("schedule"))  # type: ignore[arg-type]
    with pytest.raises(BagError, match=message):
        read_scene(tmp_path / "bag")


def test_shapes_are_those_that_were_described(robot: RobotModel) -> None:
    shapes = read_shapes(DescribedRobot(robot.urdf).pin, robot.urdf)
    base = [shape for shape in shapes if shape.link == "base_link"]
    assert [shape.size for shape in base] == [robot.description.base.size] + [
        panel.size for panel in robot.description.base.panels
    ]
    for arm in robot.description.arms:
        (gripper,) = (shape for shape in shapes if shape.link == arm.gripper.name)
        assert gripper.kind == "cylinder"
        assert gripper.size == pytest.approx((arm.gripper.radius, arm.gripper.length))
        assert gripper.pose_in_link.position == pytest.approx([0.0, 0.0, arm.gripper.length / 2.0])
        assert tool_frame(arm.name) not in {shape.link for shape in shapes}


def test_a_shape_that_cannot_be_shown_is_named(robot: RobotModel) -> None:
    urdf = robot.urdf.replace('<box size="1.0 1.0 1.0" />', '<sphere radius="0.5" />')
    with pytest.raises(RobotDescriptionError, match="'base_link' is drawn as a Sphere"):
        read_shapes(DescribedRobot(urdf).pin, urdf)


def test_text_that_is_no_robot_is_refused() -> None:
    with pytest.raises(RobotDescriptionError, match="the robot description cannot be read"):
        DescribedRobot("<robot/>")
