"""Where each phase will end is foreseen from the schedule, and what cannot be done is refused by name."""

import re
from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.errors import ScheduleError
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.model.poses import pose_distance, pose_row, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.run_data import RunData
from sms_handover.simulation import feasibility, predicted_momentum
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.feasibility import PhasePrediction, check_feasibility
from sms_handover.simulation.predicted_momentum import base_after
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import initial_joints
from sms_handover.trajectory.schedule import ToolTarget
from sms_handover.types import Array, IkRequest, IkStatus, Pose

from .conftest import SCHEDULE, Draw, MakeScenario, slope

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS
_A_CARRIES = "xyz: [1.15, 0.02, 0.75]"  # where arm A takes its tool in the phase 'carry'
_B_COMES = "xyz: [1.15, -0.22, 0.75]"  # where arm B meets the other end of the deputy
_B_LEAVES = "xyz: [1.2, -0.42, 0.75]"


def predicted(scenario: Scenario) -> tuple[PhasePrediction, ...]:
    """Return the predictions with the parameters of a scenario."""
    parameters = scenario.parameters
    tolerance = parameters.plant.grasp_tolerance
    return check_feasibility(scenario.truth.robot, scenario.truth.schedule, parameters.ik, tolerance)


def _changed(old: str, new: str) -> str:
    """Return the schedule with one text replaced."""
    assert SCHEDULE.count(old) == 1
    return SCHEDULE.replace(old, new)


def _centre(robot: RobotModel, base: Pose, joints: Array) -> Array:
    """Return the centre of mass in ``world``."""
    return np.array(pin.centerOfMass(robot.pin, robot.data, robot.configuration(base, joints)))


# --- the reaction of the base --------------------------------------------------------------------


def test_the_way_back_undoes_the_way_there(robot: RobotModel, draw: Draw) -> None:
    """The same joint path backwards brings the base back, to rounding: the midpoint rule is symmetric."""
    base, start, end = draw.pose(), draw.joints(0.3), draw.joints(0.3)
    there = base_after(robot, base, start, end)
    assert max(pose_distance(base, there)) > 1e-3
    assert max(pose_distance(base, base_after(robot, there, end, start))) <= 128 * _ROUNDING


def test_the_centre_of_mass_stays_where_it_is(
    robot: RobotModel, draw: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """This holds for every path: it fails only by the error of the path's steps, which is of order 2."""
    base, start, end = draw.pose(), draw.joints(0.3), draw.joints(0.3)
    before = _centre(robot, base, start)
    counts, errors = [16, 32, 64], []
    for count in counts:
        monkeypatch.setattr(predicted_momentum, "_PATH_STEPS", count)
        after = base_after(robot, base, start, end)
        errors.append(float(np.linalg.norm(_centre(robot, after, end) - before)))
    assert slope([1.0 / count for count in counts], errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-4  # [m] a hundredth of the least grasp tolerance


def test_the_base_moves_against_the_arms(robot: RobotModel) -> None:
    """An arm stretched forward pushes the base back, by about the arm's share of the mass of its way."""
    home = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    bent = np.tile([0.0, -1.2, 0.0, -2.2, 0.0, 0.0, 0.0], 2)
    stretched = np.tile([0.0, -0.2, 0.0, -0.4, 0.0, 0.0, 0.0], 2)
    after = base_after(robot, home, bent, stretched)
    assert after.position[0] < -1e-3


def test_nothing_moves_nothing(robot: RobotModel, draw: Draw) -> None:
    """Joints that stay leave the base in place."""
    base, joints = draw.pose(), draw.joints()
    assert max(pose_distance(base, base_after(robot, base, joints, joints))) <= 64 * _ROUNDING


# --- predictions ---------------------------------------------------------------------------------


def _walk(scenario: Scenario) -> Iterator[tuple[PhasePrediction, Pose, Array]]:
    """Yield each prediction with base and joints at the start of its phase."""
    base, joints = (
        scenario.truth.schedule.base_in_world,
        initial_joints(scenario.truth.robot, scenario.truth.schedule),
    )
    for prediction in predicted(scenario):
        yield prediction, base, joints
        base, joints = prediction.base_in_world, prediction.joint_position


def test_tools_and_base_agree_in_every_prediction(make_scenario: MakeScenario) -> None:
    """At the predicted end the tools are at their targets, and the base is where they have pushed it."""
    scenario = make_scenario()
    robot, ik = scenario.truth.robot, scenario.parameters.ik
    names = []
    for (prediction, base, joints), phase in zip(
        _walk(scenario), scenario.truth.schedule.phases, strict=True
    ):
        names.append(prediction.phase)
        end, angles = prediction.base_in_world, prediction.joint_position
        assert np.all(angles >= robot.lower) and np.all(angles <= robot.upper)
        tools = robot.tools_in_world(end, angles)
        for arm, target in phase.targets.items():
            if isinstance(target, ToolTarget):
                metres, radians = pose_distance(tools[arm], target.tool_in_world)
                assert metres <= ik.position_tolerance and radians <= ik.orientation_tolerance
        # the fixed point is found to 1e-9 in each of position and angle
        assert max(pose_distance(base_after(robot, base, joints, angles), end)) <= 2e-9
        turned = pose_distance(scenario.truth.schedule.base_in_world, end)[1]
        assert prediction.base_rotation_angle == turned
        assert prediction.restarts == 0
    assert names == ["approach", "carry", "withdraw", "let go"]


def test_each_kind_of_target_is_predicted(make_scenario: MakeScenario) -> None:
    """Hold keeps the joints, a joint target is met exactly, a grasp frame where the deputy then is."""
    scenario = make_scenario()
    robot, schedule = scenario.truth.robot, scenario.truth.schedule
    a, b = (robot.arm_joints[arm] for arm in ("arm_a", "arm_b"))
    approach, carry, withdraw, let_go = predicted(scenario)
    start = initial_joints(robot, schedule)
    np.testing.assert_array_equal(approach.joint_position[b], start[b])
    np.testing.assert_array_equal(withdraw.joint_position[a], [0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1])
    np.testing.assert_array_equal(let_go.joint_position[a], withdraw.joint_position[a])
    # B holds the right end in 'withdraw' and leaves the deputy there; then it is sent 50 mm off that end
    taken, left = (
        robot.tools_in_world(end.base_in_world, end.joint_position)["arm_b"] for end in (withdraw, let_go)
    )
    off = se3_of(taken).actInv(se3_of(left))
    # B took hold with the errors of inverse kinematics, twice
    np.testing.assert_allclose(off.translation, [0.0, 0.0, -0.05], atol=4e-6)
    assert carry.base_rotation_angle > 0.0


def test_a_robot_that_holds_stays(make_scenario: MakeScenario) -> None:
    """Without a motion there is no reaction: the prediction is the start itself."""
    text = SCHEDULE[: SCHEDULE.index("  - name: carry")].replace("{grasp_frame: left}", "hold")
    scenario = make_scenario(text)
    (prediction,) = predicted(scenario)
    np.testing.assert_array_equal(
        prediction.joint_position, initial_joints(scenario.truth.robot, scenario.truth.schedule)
    )
    assert (
        max(pose_distance(prediction.base_in_world, scenario.truth.schedule.base_in_world)) <= 64 * _ROUNDING
    )
    assert prediction.base_rotation_angle <= 64 * _ROUNDING


def test_the_same_schedule_has_the_same_predictions(make_scenario: MakeScenario) -> None:
    """Bit for bit, and a run after the check is the run without it."""
    scenario = make_scenario(common={"duration": 0.1})
    alone = simulate(scenario)
    first, second = predicted(scenario), predicted(scenario)
    for a, b in zip(first, second, strict=True):
        assert a.joint_position.tobytes() == b.joint_position.tobytes()
        assert pose_row(a.base_in_world).tobytes() == pose_row(b.base_in_world).tobytes()
    assert simulate(scenario).joint_position.tobytes() == alone.joint_position.tobytes()


def test_a_prediction_cannot_be_changed(make_scenario: MakeScenario) -> None:
    """It is a value."""
    prediction = predicted(make_scenario())[0]
    with pytest.raises(ValueError, match="read-only"):
        prediction.joint_position[0] = 0.0


def test_the_shipped_handover_ends_where_it_was_foreseen(nmpc_run: RunData, scenario: Scenario) -> None:
    """The joints settle where predicted, and the base, but for the difference of straight and real paths.

    That difference is of second order in the motion. A tenth of the base's whole motion bounds it.
    """
    predictions = predicted(scenario)
    start = scenario.truth.schedule.base_in_world
    assert [prediction.restarts for prediction in predictions] == [0] * len(predictions)
    ways = [pose_distance(start, prediction.base_in_world) for prediction in predictions]
    for prediction, phase in zip(predictions, scenario.truth.schedule.phases, strict=True):
        row = int(np.searchsorted(nmpc_run.tick_ns, phase.end_ns))
        found = Pose(nmpc_run.base_pose[row, :3], nmpc_run.base_pose[row, 3:])
        metres, radians = pose_distance(prediction.base_in_world, found)
        assert metres < 0.1 * max(way[0] for way in ways)
        assert radians < 0.1 * max(way[1] for way in ways)


# --- what cannot be done -------------------------------------------------------------------------


def test_a_target_out_of_reach_is_named(make_scenario: MakeScenario) -> None:
    """Phase, arm, where the target is, and how far the nearest pose is from it: in one line."""
    scenario = make_scenario(_changed(_B_COMES, "xyz: [1.95, -0.22, 0.75]"))
    with pytest.raises(ScheduleError) as caught:
        predicted(scenario)
    match = re.fullmatch(
        r"phase 'carry': the target of arm_b at \(1\.950, -0\.220, 0\.750\) m is out of reach: "
        r"the nearest pose found is ([\d.]+) mm and ([\d.]+) deg away",
        str(caught.value),
    )
    assert match
    metres, radians = float(match[1]) / 1000.0, np.radians(float(match[2]))
    # nothing sampled at random comes nearer, with the base as it was at the start or pushed back from there
    target = scenario.truth.schedule.phases[1].targets["arm_b"]
    assert isinstance(target, ToolTarget)
    draw, robot = Draw(scenario.truth.robot, seed=1), scenario.truth.robot
    nearest = np.inf
    for _ in range(5000):
        tools = robot.tools_in_world(scenario.truth.schedule.base_in_world, draw.joints())
        apart = pose_distance(tools["arm_b"], target.tool_in_world)
        nearest = min(nearest, apart[0] ** 2 + apart[1] ** 2)
    assert metres > 0.1
    assert metres**2 + radians**2 <= nearest


@pytest.mark.parametrize(
    ("old", "new", "phase", "arm"),
    [
        ("in_world: {xyz: [1.25, 0.0, 0.75]", "in_world: {xyz: [2.6, 0.0, 0.75]", "approach", "arm_a"),
        (_A_CARRIES, "xyz: [-1.5, 0.02, 0.75]", "carry", "arm_a"),
        (_B_LEAVES, "xyz: [1.2, -0.42, 3.75]", "withdraw", "arm_b"),
        ("xyz: [0.0, 0.0, -0.05]", "xyz: [0.0, 0.0, 1.5]", "let go", "arm_b"),
    ],
)
def test_every_phase_and_arm_is_checked(
    make_scenario: MakeScenario, old: str, new: str, phase: str, arm: str
) -> None:
    """Targets in the world and at grasp frames, in the first phase and in the last."""
    with pytest.raises(ScheduleError, match=rf"^phase '{phase}': the target of {arm} at \(.* out of reach"):
        predicted(make_scenario(_changed(old, new)))


def test_targets_that_do_not_fit_the_deputy_are_refused(make_scenario: MakeScenario) -> None:
    """Where A holds one end, B's target must be the other end: 63 mm beside it the transfer would miss."""
    scenario = make_scenario(_changed(_B_COMES, "xyz: [1.15, -0.283, 0.75]"))
    with pytest.raises(ScheduleError) as caught:
        predicted(scenario)
    expected = "phase 'withdraw': arm_b would miss grasp frame 'right': distance 63 mm, allowed 10 mm"
    assert str(caught.value) == expected


def test_the_angle_must_fit_too(make_scenario: MakeScenario) -> None:
    """A tool turned by 0.1 rad at the right place would miss."""
    text = _changed(f"{_B_COMES}, rpy: [3.14, -1.5, 0.0]", f"{_B_COMES}, rpy: [3.14, -1.4, 0.0]")
    with pytest.raises(
        ScheduleError, match=r"arm_b would miss grasp frame 'right': angle 5\.73 deg, allowed 2"
    ):
        predicted(make_scenario(text))


def test_the_tolerance_is_that_of_the_plant(make_scenario: MakeScenario) -> None:
    """An offset of 8 mm fits 10 mm and not 5 mm."""
    text = _changed(_B_COMES, "xyz: [1.15, -0.228, 0.75]")
    assert len(predicted(make_scenario(text))) == 4
    with pytest.raises(ScheduleError, match="distance 8 mm, allowed 5 mm"):
        predicted(make_scenario(text, plant={"grasp_position_tolerance": 0.005}))


def test_reach_is_that_of_the_solver(make_scenario: MakeScenario) -> None:
    """What is in reach depends on the parameters of inverse kinematics: those of the scenario count."""
    with pytest.raises(ScheduleError, match="is out of reach"):
        check_scenario(make_scenario(ik={"stall_step": 0.1}))
    far = _changed(_B_LEAVES, "xyz: [1.2, -0.42, 3.75]")
    loose = {"position_tolerance": 3.0, "orientation_tolerance": 3.0}
    assert (
        len(
            predicted(
                make_scenario(
                    far, ik=loose, plant={"grasp_position_tolerance": 9.0, "grasp_angle_tolerance": 4.0}
                )
            )
        )
        == 4
    )


def test_an_error_of_the_first_grasp_is_carried_on(make_scenario: MakeScenario) -> None:
    """A deputy grasped 8 mm off stays 8 mm off in the hand, so the other end is too."""
    offset = "arm_a: {grasp_frame: left, tool_in_grasp_frame: {xyz: [0, 0.008, 0], rpy: [0, 0, 0]}}"
    text = _changed("arm_a: {grasp_frame: left}\n", f"{offset}\n")
    assert len(predicted(make_scenario(text))) == 4
    both = text.replace(_B_COMES, "xyz: [1.15, -0.228, 0.75]")
    with pytest.raises(ScheduleError, match=r"arm_b would miss grasp frame 'right': distance 1[0-9.]+ mm"):
        predicted(make_scenario(both))


def test_a_target_on_a_deputy_that_the_other_arm_carries(make_scenario: MakeScenario) -> None:
    """B is sent to its end of the deputy while A moves it: the end is where A will have taken it."""
    text = _changed(
        f"arm_b: {{tool_in_world: {{{_B_COMES}, rpy: [3.14, -1.5, 0.0]}}}}", "arm_b: {grasp_frame: right}"
    )
    scenario = make_scenario(text)
    carry = predicted(scenario)[1]
    tool = scenario.truth.robot.tools_in_world(carry.base_in_world, carry.joint_position)["arm_b"]
    expected = Pose(np.array([1.15, -0.22, 0.75]), np.array([0.0, 0.0, 0.0, 1.0]))
    # A is at its target and holds its end, each within the tolerance of inverse kinematics, 1e-6 m and rad
    assert np.linalg.norm(tool.position - expected.position) < 4e-6


# --- restarts ------------------------------------------------------------------------------------


def test_a_target_that_needs_another_start_is_found_and_told(make_scenario: MakeScenario) -> None:
    """Where the present joints do not lead to a target in reach, random ones are tried, always the same."""
    scenario = make_scenario()
    robot, draw = scenario.truth.robot, Draw(scenario.truth.robot, seed=6)
    base, start = (
        scenario.truth.schedule.base_in_world,
        initial_joints(scenario.truth.robot, scenario.truth.schedule),
    )
    for _ in range(200):
        tool = robot.tools_in_world(base, draw.joints(margin=0.3))["arm_a"]
        request = IkRequest(base, start, {"arm_a": tool})
        if solve_ik(robot, request, scenario.parameters.ik).status is not IkStatus.CONVERGED:
            break
    xyz = [float(x) for x in tool.position]
    rpy = [float(x) for x in pin.rpy.matrixToRpy(se3_of(tool).rotation)]
    text = SCHEDULE[: SCHEDULE.index("  - name: carry")]
    text = text.replace("{grasp_frame: left}", f"{{tool_in_world: {{xyz: {xyz}, rpy: {rpy}}}}}")
    scenario = make_scenario(text)
    (prediction,) = predicted(scenario)
    assert 1 <= prediction.restarts <= 10
    found = robot.tools_in_world(prediction.base_in_world, prediction.joint_position)["arm_a"]
    assert max(pose_distance(found, tool)) <= 1e-6 + _ROUNDING
    again = predicted(make_scenario(text))[0]
    assert again.joint_position.tobytes() == prediction.joint_position.tobytes()


def test_restarts_begin_where_no_bodies_overlap(scenario: Scenario) -> None:
    """A third of all random configurations do not qualify; the arms that do not miss stay where they are."""
    world, ik = scenario.model, scenario.parameters.ik
    robot, base = world.robot, world.schedule.base_in_world
    walk = feasibility._Walk(robot, world.schedule, ik, feasibility.ANY_GRASP)
    start = initial_joints(robot, world.schedule)
    distances = ClearanceModel(robot.pin, robot.urdf, robot.arms, world.schedule.deputy.size)
    of_robot = [k for k, (_, other) in enumerate(distances.pairs) if other.kind is not BodyKind.DEPUTY]
    random = np.random.default_rng(16)
    for missed in (["arm_a"], ["arm_b"], ["arm_a", "arm_b"]) * 10:
        rest = feasibility._Rest(base, start, {}, dict.fromkeys(missed, (1.0, 1.0)))
        seed = walk._restart(rest, random)
        q = robot.configuration(base, seed)
        assert distances.distances(q, world.schedule.deputy.deputy_in_world)[of_robot].min() >= 0.0
        for arm in robot.arms:
            part = robot.arm_joints[arm]
            assert np.array_equal(seed[part], start[part]) is (arm not in missed)
            assert (seed[part] >= robot.lower[part]).all() and (seed[part] <= robot.upper[part]).all()
