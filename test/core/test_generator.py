"""The trajectory generator gives each phase its targets, its commands once, and rates that fit."""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.model.poses import pose_distance, pose_of, pose_row, se3_of
from sms_handover.model.reduced import generalized_jacobian, tool_jacobian
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.wiring import initial_joints
from sms_handover.trajectory.generator import Targets, TrajectoryGenerator
from sms_handover.trajectory.pose_path import PosePath
from sms_handover.trajectory.schedule import GraspFrameTarget, ToolTarget
from sms_handover.trajectory.time_law import quintic
from sms_handover.types import Array, Pose, RobotState, TaskPhase

from .conftest import Draw, MakeScenario, row_distance, run, state_of

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS
_PERIOD_NS = 20_000_000


class Bench:
    """A generator and a robot that stands where it began."""

    def __init__(self, scenario: Scenario) -> None:
        """Put the robot at the start of the schedule."""
        self.scenario, self.robot, self.schedule = scenario, scenario.truth.robot, scenario.truth.schedule
        self.generator = TrajectoryGenerator(self.robot, self.schedule, scenario.parameters.trajectory)
        self.joints = initial_joints(self.robot, self.schedule)
        self.deputy = self.schedule.deputy.deputy_in_world

    def state(self, time: float, joints: Array | None = None) -> RobotState:
        """Return a state at rest at a time in s."""
        position = self.joints if joints is None else joints
        q = self.robot.configuration(self.schedule.base_in_world, position)
        return state_of(self.robot, q, np.zeros(20), round(time * 1e9))

    def at(self, time: float, joints: Array | None = None) -> tuple[TaskPhase, Targets]:
        """Return phase and targets at a time in s."""
        return self.generator.targets(self.state(time, joints), self.deputy)


@pytest.fixture
def stepping(make_scenario: MakeScenario) -> Bench:
    """The small handover with targets that jump."""
    return Bench(make_scenario(trajectory={"time_law": "step"}))


@pytest.fixture
def smooth(make_scenario: MakeScenario) -> Bench:
    """The small handover with quintic motions."""
    return Bench(make_scenario(trajectory={"time_law": "quintic"}))


def _periods(end: float) -> list[float]:
    """Return the times of the references up to an end, in s."""
    return [0.02 * k for k in range(round(end / 0.02) + 1)]


# --- phases --------------------------------------------------------------------------------------


def test_each_command_is_given_once(stepping: Bench) -> None:
    """At the first reference of its phase and never again, also after the schedule has ended."""
    given = []
    for time in _periods(2.0):
        task, _ = stepping.at(time)
        given += [(round(time, 2), command) for command in task.commands]
    phases = stepping.schedule.phases
    expected = [(phase.start_ns / 1e9, command) for phase in phases for command in phase.commands]
    assert given == expected
    assert len(given) == 3


def test_phases_are_announced_as_they_come(stepping: Bench) -> None:
    """Index and name of the phase in force stand in every reference, with the stamp of the state."""
    seen = [stepping.at(time)[0] for time in _periods(1.4)]
    names = [phase.name for phase in stepping.schedule.phases]
    assert [task.stamp_ns for task in seen] == [k * _PERIOD_NS for k in range(71)]
    assert sorted({(task.index, task.name) for task in seen}) == list(enumerate(names))


def test_reset_begins_anew(stepping: Bench) -> None:
    """After a reset the commands of the first phases come again."""
    runs = []
    for _ in range(2):
        runs.append([stepping.at(time)[0].commands for time in _periods(1.4)])
        stepping.generator.reset()
    assert runs[0] == runs[1]


# --- targets -------------------------------------------------------------------------------------


def test_an_arm_on_hold_keeps_what_it_had_when_its_phase_began(stepping: Bench, draw: Draw) -> None:
    """Its reference does not follow it when it is pushed away later."""
    part = stepping.robot.arm_joints["arm_b"]
    for time in _periods(0.38):
        _, targets = stepping.at(time, stepping.joints + (draw.vector(14, 0.1) if time else 0.0))
        np.testing.assert_array_equal(targets.joint_position[part], stepping.joints[part])
        assert not np.any(targets.joint_velocity)
        assert "arm_b" not in targets.tool_in_world


def test_a_step_target_is_the_goal_at_once(stepping: Bench) -> None:
    """The tool's target is the pose of the schedule, from the first instant of the phase, without a twist."""
    _, targets = stepping.at(0.4)
    goal = stepping.schedule.phases[1].targets["arm_a"]
    assert isinstance(goal, ToolTarget)
    assert targets.tool_in_world["arm_a"] is goal.tool_in_world
    twist = targets.tool_twist_in_world["arm_a"]
    assert not np.any(twist.linear) and not np.any(twist.angular)
    _, targets = stepping.at(1.0)
    part = stepping.robot.arm_joints["arm_a"]
    np.testing.assert_array_equal(targets.joint_position[part], [0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1])


def test_a_grasp_frame_target_follows_the_deputy(stepping: Bench, draw: Draw) -> None:
    """The goal is the grasp frame wherever the deputy is now, with the offset of the schedule in it."""
    frames = stepping.schedule.deputy.grasp_frames
    for _ in range(3):
        stepping.deputy = draw.pose()
        _, targets = stepping.at(0.1)
        expected = pose_of(se3_of(stepping.deputy) * se3_of(frames["left"]))
        assert max(pose_distance(targets.tool_in_world["arm_a"], expected)) <= _ROUNDING
        _, targets = stepping.at(1.3)
        offset = pose_of(se3_of(stepping.deputy) * se3_of(frames["right"]))
        pose = targets.tool_in_world["arm_b"]
        relative = se3_of(offset).actInv(se3_of(pose))
        np.testing.assert_allclose(relative.translation, [0.0, 0.0, -0.05], atol=_ROUNDING)


@pytest.mark.parametrize(
    "given", [{"mass": 4.0}, {"twist_in_world": {"linear": [0, 0, 0], "angular": [0, 0, 1]}}]
)
def test_a_target_at_a_deputy_that_moves_has_its_twist(
    make_scenario: MakeScenario, draw: Draw, given: dict[str, object]
) -> None:
    """On a screw the velocity of the grasp frame, whatever the deputy was said to do at first."""
    bench = Bench(make_scenario(trajectory={"time_law": "step"}, deputy=given))
    bench.at(0.0)
    start, linear, angular = se3_of(bench.deputy), draw.vector(3), draw.vector(3)
    for time in (0.02, 0.04):
        turn = pin.exp3(time * angular)
        bench.deputy = pose_of(pin.SE3(turn @ start.rotation, start.translation + time * linear))
        _, targets = bench.at(time)
        twist, lever = targets.tool_twist_in_world["arm_a"], targets.tool_in_world["arm_a"].position
        velocity = linear + np.cross(angular, lever - bench.deputy.position)
        np.testing.assert_allclose(twist.linear, velocity, atol=1e-12)
        np.testing.assert_allclose(twist.angular, angular, atol=1e-12)
    state = bench.generator.snapshot()
    first = bench.at(0.06)[1].tool_twist_in_world["arm_a"].row
    bench.generator.restore(state)
    np.testing.assert_array_equal(bench.at(0.06)[1].tool_twist_in_world["arm_a"].row, first)
    bench.generator.reset()
    initial = bench.schedule.deputy.twist_in_world
    np.testing.assert_array_equal(bench.at(0.0)[1].tool_twist_in_world["arm_a"].angular, initial.angular)


def test_a_quintic_target_moves_on_its_path(smooth: Bench) -> None:
    """From the tool pose at the start of the phase to the goal in the motion time, then it stands."""
    smooth.at(0.38)
    base = smooth.schedule.base_in_world
    start = smooth.robot.tools_in_world(base, smooth.joints)["arm_a"]
    goal = smooth.schedule.phases[1].targets["arm_a"]
    assert isinstance(goal, ToolTarget)
    path = PosePath(start, goal.tool_in_world)
    for time in _periods(0.58):
        _, targets = smooth.at(0.4 + time)
        pose, twist = path.at(quintic(time, 0.6))
        found = targets.tool_twist_in_world["arm_a"]
        assert max(pose_distance(targets.tool_in_world["arm_a"], pose)) <= _ROUNDING
        # the stamp is a whole number of ns; rates change by less than 1 / ns of that
        np.testing.assert_allclose(found.linear, twist.linear, atol=1e-9)
        np.testing.assert_allclose(found.angular, twist.angular, atol=1e-9)


def test_a_quintic_joint_motion_has_its_rate(smooth: Bench) -> None:
    """Joints led by joints go straight from where they were, at the rate of the law."""
    part = smooth.robot.arm_joints["arm_a"]
    start, end = smooth.joints[part], np.array([0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1])
    smooth.at(0.98)
    for time in _periods(0.18):
        _, targets = smooth.at(1.0 + time)
        progress = quintic(time, 0.2)
        np.testing.assert_allclose(
            targets.joint_position[part], start + progress.fraction * (end - start), atol=1e-9
        )
        np.testing.assert_allclose(targets.joint_velocity[part], progress.rate * (end - start), atol=1e-8)


# --- requests and references ---------------------------------------------------------------------


def test_inverse_kinematics_is_asked_from_the_present_joints(stepping: Bench, draw: Draw) -> None:
    """Base where it is now, led arms seeded with their present joints, the others at their desired ones."""
    stepping.at(0.0)
    joints = stepping.joints + draw.vector(14, 0.05)
    state = stepping.state(0.02, joints)
    _, targets = stepping.generator.targets(state, stepping.deputy)
    request = stepping.generator.ik_request(state, targets)
    part_a, part_b = (stepping.robot.arm_joints[arm] for arm in ("arm_a", "arm_b"))
    assert request.base_in_world is state.base_in_world
    assert set(request.tool_in_world) == {"arm_a"}
    np.testing.assert_array_equal(request.seed[part_a], joints[part_a])
    np.testing.assert_array_equal(request.seed[part_b], stepping.joints[part_b])


def test_a_reference_has_the_joints_that_were_found(stepping: Bench, draw: Draw) -> None:
    """At rest for a step target; every arm has a target pose, led by its joints or not."""
    state = stepping.state(1.0)
    _, targets = stepping.generator.targets(state, stepping.deputy)
    joints = draw.joints()
    reference, poses = stepping.generator.reference(state, targets, joints)
    np.testing.assert_array_equal(reference.position, joints)
    assert not np.any(reference.velocity)
    assert reference.stamp_ns == state.stamp_ns
    by_joints = stepping.robot.tools_in_world(state.base_in_world, joints)["arm_a"]
    np.testing.assert_array_equal(pose_row(poses["arm_a"]), pose_row(by_joints))
    assert poses["arm_b"] is targets.tool_in_world["arm_b"]


@pytest.mark.parametrize("time", [0.06, 0.14, 0.7, 1.06, 1.26])
def test_reference_rates_bring_about_the_tool_twist(smooth: Bench, time: float) -> None:
    """With the base giving way, the tools move as their twists say, whatever the other arm does.

    Damping of the inverse changes a twist by at most d^2 / (s^2 + d^2), s the smallest singular value.
    """
    robot: RobotModel = smooth.robot
    for earlier in (0.0, 0.4, 1.0, 1.2):
        if earlier < time:
            smooth.at(earlier)
    state = smooth.state(time)
    _, targets = smooth.generator.targets(state, smooth.deputy)
    request = smooth.generator.ik_request(state, targets)
    solution = solve_ik(robot, request, smooth.scenario.parameters.ik)
    reference, _ = smooth.generator.reference(state, targets, solution.joint_position)
    q = state.q
    led = [arm for arm in robot.arms if arm in targets.tool_twist_in_world]
    assert led
    twists = [targets.tool_twist_in_world[arm] for arm in led]
    wanted = np.concatenate([part for twist in twists for part in (twist.linear, twist.angular)])
    jacobian = np.vstack([generalized_jacobian(robot, q, arm) for arm in led])
    columns = np.concatenate([np.arange(14)[robot.arm_joints[arm]] for arm in led])
    smallest = np.linalg.svd(jacobian[:, columns], compute_uv=False)[-1]
    damping = smooth.scenario.parameters.trajectory.jacobian_damping
    others = np.array(reference.velocity)
    others[columns] = 0.0
    rest = float(np.linalg.norm(wanted - jacobian @ others))
    bound = damping**2 / (smallest**2 + damping**2) * rest + 100 * _EPS
    assert np.linalg.norm(wanted) > 100 * bound
    np.testing.assert_allclose(jacobian @ reference.velocity, wanted, atol=bound)
    for arm in set(robot.arms) - set(led):
        part = robot.arm_joints[arm]
        np.testing.assert_array_equal(reference.velocity[part], targets.joint_velocity[part])


# --- through a run -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def quintic_run() -> RunData:
    """The first seconds of the shipped handover with the quintic law and a finer inverse kinematics."""
    return run(
        common={"duration": 4.0},
        controller={"law": "nmpc"},
        trajectory={"time_law": "quintic"},
        ik={"position_tolerance": 1e-9, "orientation_tolerance": 1e-9},
    )


def test_target_moves_by_the_quintic_law(quintic_run: RunData, scenario: Scenario) -> None:
    """Through the run the tool target has covered the fraction of its way that the law says."""
    phase = scenario.truth.schedule.phases[0]
    rows = quintic_run.target_pose["arm_a"]
    start = quintic_run.tool_pose["arm_a"][0]
    target, deputy = phase.targets["arm_a"], scenario.truth.schedule.deputy
    assert isinstance(target, GraspFrameTarget)
    frame = se3_of(deputy.deputy_in_world) * se3_of(deputy.grasp_frames[target.grasp_frame])
    goal = pose_row(pose_of(frame * se3_of(target.tool_in_grasp_frame)))
    metres, radians = row_distance(start, goal)
    for stamp, row in zip(quintic_run.reference_ns, rows, strict=True):
        x = float(stamp) / phase.motion_ns
        fraction = 10 * x**3 - 15 * x**4 + 6 * x**5
        done = row_distance(start, row)
        assert done == pytest.approx((fraction * metres, fraction * radians), abs=10 * _ROUNDING)


def test_reference_velocity_is_the_rate_of_the_reference(quintic_run: RunData, scenario: Scenario) -> None:
    """The reference from inverse kinematics moves as its velocity from the generalised Jacobian says.

    They are found in different ways: one solves for joints at the base where it is, the other for
    rates with the base's reaction. Redundancy leaves one direction open, which is left out here.
    The base's reaction is large enough to be seen: without it the two would not agree.
    """
    robot = scenario.truth.robot
    period, seen = _PERIOD_NS * 1e-9, []
    for row in range(20, len(quintic_run.reference_ns) - 1, 20):
        ahead, behind = (quintic_run.reference_position[row + side] for side in (1, -1))
        difference = (ahead - behind) / (2.0 * period)
        base = quintic_run.base_pose[row * 20]
        joints = quintic_run.reference_position[row]
        q = robot.configuration(Pose(base[:3], base[3:]), joints)
        jacobian = generalized_jacobian(robot, q, "arm_a")
        found = jacobian @ difference
        wanted = jacobian @ quintic_run.reference_velocity[row]
        # second order in the period: rates change by the law's 60 / T^3 per s^2 over ways below 1
        motion = scenario.truth.schedule.phases[0].motion_ns * 1e-9
        bound = period**2 / 6.0 * 60.0 / motion**3 * 4.0 + 2.0 * 1e-9 / period
        np.testing.assert_allclose(found, wanted, atol=bound)
        assert not np.any(quintic_run.reference_velocity[row][robot.arm_joints["arm_b"]])
        without = tool_jacobian(robot, q, "arm_a")[:, BASE_NV:] @ quintic_run.reference_velocity[row]
        seen.append(float(np.max(np.abs(without - wanted))) / bound)
    assert max(seen) > 10.0


def test_arm_b_holds_during_the_first_third(handover: RunData, scenario: Scenario) -> None:
    """Under either law, arm B's reference is its initial configuration and does not move."""
    part = scenario.truth.robot.arm_joints["arm_b"]
    start = initial_joints(scenario.truth.robot, scenario.truth.schedule)[part]
    end = scenario.truth.schedule.end_ns // 3
    rows = handover.reference_ns < end
    assert np.count_nonzero(rows) == end // _PERIOD_NS
    held = handover.reference_position[rows][:, part]
    np.testing.assert_array_equal(held, np.broadcast_to(start, held.shape))
    assert not np.any(handover.reference_velocity[rows][:, part])
