"""The shipped scenarios of other robots: possible from beginning to end, and the plane in closed form."""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from docs.scenario_pictures import LARGEST, picture_of
from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.analysis.joint_limits import limit_use
from sms_handover.analysis.table import comparison_table
from sms_handover.cli.recorded_runs import read_all
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.model.parts import cylinder_moments
from sms_handover.model.poses import se3_of
from sms_handover.report.page import report_page
from sms_handover.run_data import RunData
from sms_handover.scene.page import animation_html
from sms_handover.scene.recorded_scene import read_scene
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.trajectory.schedule import JointTarget
from sms_handover.types import GraspStatus, Pose

from ..documents import blocks
from ..workspace import ROOT
from .report_bags import parameters, write_bag

PAGE = ROOT / "docs" / "scenarios.md"
PERIOD = 0.1  # [s] tick and reference period: smooth motions of 8 s and more need no shorter one
HOLDERS = {  # who takes the deputy, one after the other; "" is nobody
    "one_arm": ["arm_a", ""],
    "three_arms": ["arm_a", "arm_b", "arm_c"],
    "six_joints": ["arm_a", "arm_b"],
    "planar": ["arm_a", "arm_b", ""],
    "massive": ["arm_a", "arm_b"],
    "tumbling": ["arm_a", "arm_b"],
}
JOINTS = {"one_arm": 7, "three_arms": 21, "six_joints": 12, "planar": 4, "massive": 14, "tumbling": 14}


@dataclass(frozen=True, eq=False)
class Run:
    """A scenario and its whole run, at a coarse tick."""

    name: str
    scenario: Scenario
    data: RunData


@pytest.fixture(scope="module", params=HOLDERS)
def run(request: pytest.FixtureRequest) -> Run:
    return run_of(request.param)


@pytest.fixture(scope="module")
def planar() -> RunData:
    return run_of("planar").data


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    """What the program of the page leaves behind: its functions, and the angles that it finds."""
    (program,) = [block.text for block in blocks(PAGE) if block.language == "python"]
    found: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(program, found)  # what readers are told to run
    return found


@cache
def run_of(name: str, duration: float = 0.0) -> Run:
    """Return the run of a scenario for so many seconds, 0 is to its end."""
    common = {"tick": PERIOD, "reference_period": PERIOD, "duration": duration}
    scenario = load_scenario(name, {"common": common})
    return Run(name, scenario, simulate(scenario))


def test_every_scenario_has_its_section_and_picture() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in scenario_names():
        assert f"\n## {name}\n" in text
        assert f"simulate {name}\n" in text
        assert f"](images/{picture_of(name).name})" in text
        assert picture_of(name).stat().st_size <= 1000 * LARGEST


def test_the_deputy_goes_from_hand_to_hand(run: Run) -> None:
    events = run.data.grasp_events
    assert [event.status for event in events] == [GraspStatus.SUCCEEDED] * len(HOLDERS[run.name])
    commands = [event.command for event in events]
    takers = ["" if command.action.value == "release" else command.arm for command in commands]
    assert takers == HOLDERS[run.name]
    assert len(run.data.joint_names) == JOINTS[run.name]
    assert run.data.tick_ns[-1] == run.scenario.truth.schedule.end_ns
    assert not run.data.run_events


def test_no_bodies_touch_and_no_joint_leaves_its_limits(run: Run) -> None:
    world = run.scenario.truth
    clearance = run_clearance(run.data, TaskTexts(world.robot.urdf, world.schedule.text))
    assert clearance.collisions == ()
    assert min(group.least for group in clearance.groups) > 0.0, "not even where contact is declared"
    use = limit_use(run.data, world.robot.pin)
    assert use.position.value < 0.0
    assert use.rate.value < 1.0
    assert np.all(np.abs(run.data.joint_command) < world.robot.effort_limit)


@pytest.mark.parametrize("name", ["six_joints", "planar"])
def test_links_of_our_own_are_uniform_cylinders(name: str) -> None:
    """Also the numbers that the program of the page has."""
    for arm in load_scenario(name).truth.robot.description.arms:
        ends = [*(joint.origin.xyz for joint in arm.joints[1:]), arm.flange.xyz]
        for link, end in zip(arm.links, ends, strict=True):
            length, along = max(end), int(np.argmax(end))
            across, *_, axial = cylinder_moments(link.inertia.mass, link.radius, length)
            moments = np.full(3, across)
            moments[along] = axial
            np.testing.assert_allclose(link.inertia.matrix, np.diag(moments), rtol=1e-5)
            np.testing.assert_allclose(link.inertia.com, np.array(end) / 2.0)
        assert arm.mass == pytest.approx({"six_joints": 7.0, "planar": 5.6}[name])


def test_the_page_finds_the_angles_of_the_schedule(page: dict[str, Any]) -> None:
    schedule = load_scenario("planar").truth.schedule
    approach, meet = (phase.targets["arm_a"] for phase in schedule.phases[:2])
    assert isinstance(approach, JointTarget) and isinstance(meet, JointTarget)
    np.testing.assert_allclose(approach.position, page["q"][:2], atol=1e-6)
    np.testing.assert_allclose(meet.position, page["meet"][:2])
    *_, z, w = schedule.deputy.deputy_in_world.quaternion_xyzw
    assert 2.0 * np.arctan2(z, w) == pytest.approx(page["theta"] + sum(page["q"][:2]) + np.pi / 2, abs=1e-6)


def test_planar_motion_stays_in_the_plane(planar: RunData) -> None:
    rounding = 1e-12
    assert np.abs(planar.base_pose[:, 2:5]).max() < rounding  # z, and x and y of the quaternion
    assert np.abs(planar.base_twist[:, 2:5]).max() < rounding
    for poses in (planar.deputy_pose, *planar.tool_pose.values()):
        assert np.abs(poses[:, 2]).max() < rounding


def test_the_base_turns_by_the_integral_over_the_joints(planar: RunData, page: dict[str, Any]) -> None:
    """With no code of ours: momentum in the plane along the joints of the run, and the centre of mass."""
    turn: Callable[..., float] = page["turn"]
    joints = planar.joint_position.tolist()
    angles = np.cumsum([0.0, *(turn(*pair) for pair in pairwise(joints))])
    measured = 2.0 * np.arctan2(planar.base_pose[:, 5], planar.base_pose[:, 6])
    np.testing.assert_allclose(measured, angles, atol=1e-5)
    centre = np.array([page["centre"](q) for q in joints])
    places = centre[0] - np.exp(1j * angles) * centre
    np.testing.assert_allclose(planar.base_pose[:, :2], np.c_[places.real, places.imag], atol=1e-5)
    assert degrees(measured[-1]) == pytest.approx(degrees(sum(page["angles"])), abs=0.01)
    assert degrees(measured[-1]) == pytest.approx(2.79, abs=0.01)  # the joints are back, the base is not


@pytest.mark.parametrize("name", ["massive", "tumbling"])
def test_a_deputy_with_mass_brings_its_momentum_and_no_more(name: str) -> None:
    """That of a rigid box, of the schedule alone, about the centre of both; it stays over every event."""
    run = run_of(name)
    robot, deputy = run.scenario.truth.robot, run.scenario.truth.schedule.deputy
    turn, (x, y, z) = se3_of(deputy.deputy_in_world).rotation, deputy.size
    moments = deputy.mass / 12.0 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])
    velocity, rate = deputy.twist_in_world.linear, deputy.twist_in_world.angular
    at = robot.configuration(run.scenario.truth.schedule.base_in_world, run.data.joint_position[0])
    apart = deputy.deputy_in_world.position - pin.centerOfMass(robot.pin, robot.data, at)
    lever = robot.mass / (robot.mass + deputy.mass) * apart  # of the deputy, from the centre of both
    linear = deputy.mass * velocity
    angular = turn @ moments @ turn.T @ rate + np.cross(lever, linear)
    truncation = 1e-6  # at this coarse tick; docs/verification.md has the shipped one
    np.testing.assert_allclose(run.data.linear_momentum - linear, 0.0, atol=truncation)
    np.testing.assert_allclose(run.data.angular_momentum - angular, 0.0, atol=truncation)
    balance = run.data.kinetic_energy + run.data.lost - run.data.work
    np.testing.assert_allclose(balance, balance[0], atol=truncation)


def test_what_tumbles_is_followed_and_afterwards_all_of_it_turns_as_one() -> None:
    """The rate that is left is L / I, of all bodies together at the last pose, in a sum over the bodies."""
    run, world = run_of("tumbling").data, run_of("tumbling").scenario.truth
    captured, _ = run.grasp_events
    assert captured.position_error < 1e-4  # m; a tool that does not know how its goal moves lags by 5 mm
    assert captured.relative_rate < np.radians(0.01)
    rate = float(np.linalg.norm(run.base_twist[-1, 3:]))
    assert np.abs(run.joint_velocity[-1]).max() < 0.1 * rate
    robot, deputy = world.robot, world.schedule.deputy
    q = np.concatenate([run.base_pose[-1], run.joint_position[-1]])
    pin.forwardKinematics(robot.pin, robot.data, q)
    bodies = [
        *((place, own) for place, own in zip(robot.data.oMi, robot.pin.inertias, strict=True)),
        (se3_of(Pose(run.deputy_pose[-1, :3], run.deputy_pose[-1, 3:])), deputy.inertia),
    ]
    placed = [place.act(own) for place, own in bodies if own.mass > 0.0]
    whole = sum(own.mass for own in placed)
    centre = sum(own.mass * own.lever for own in placed) / whole
    inertia = np.zeros((3, 3))
    for own in placed:
        arm = own.lever - centre
        inertia += own.inertia + own.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    expected = np.linalg.solve(inertia, run.angular_momentum[-1])
    turn = se3_of(Pose(run.base_pose[-1, :3], run.base_pose[-1, 3:])).rotation
    np.testing.assert_allclose(turn @ run.base_twist[-1, 3:], expected, atol=0.02 * rate)
    assert degrees(rate) == pytest.approx(0.0786, abs=5e-4)  # deg/s, as docs/scenarios.md says


def test_robots_of_all_kinds_stand_side_by_side_in_table_report_and_view(tmp_path: Path) -> None:
    """What an arm has not done, because its robot has no such arm, is a dash and not zero."""
    runs = {name: run_of(name, 2.0) for name in ("one_arm", "three_arms")}
    bags = [
        write_bag(
            tmp_path / name,
            run.data,
            urdf=run.scenario.truth.robot.urdf,
            schedule=run.scenario.truth.schedule.text,
            values=parameters("nmpc"),
        )
        for name, run in runs.items()
    ]
    recorded = read_all(bags)
    table = comparison_table({run.name: run.data for run in recorded})
    of_arm_c = table.split("\narm_c (hold)\n")[1].split("\nbase\n")[0].splitlines()
    assert len(of_arm_c) == 11
    assert [line.rsplit(maxsplit=2)[-2] for line in of_arm_c] == ["-"] * len(of_arm_c)
    page = report_page(recorded)
    assert "Joint torques of arm_c" in page
    assert animation_html({bag.name: read_scene(bag, 1.0) for bag in bags}).count("arm_c_tool") == 1
