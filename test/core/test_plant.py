"""The plant conserves what a free-floating robot conserves, and books every joule its motors give."""

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.model.conserved import ConservedQuantities
from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.plant_state import InitialState
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import Array, GraspAction, GraspCommand, GraspStatus, Pose
from sms_handover.units import ns_to_seconds

from .conftest import Draw, row_distance, slope

_EPS = np.finfo(float).eps
_MS = 1_000_000  # [ns]
_TOLERANCES: dict[str, Any] = {
    "grasp_position_tolerance": 0.01,  # m
    "grasp_angle_tolerance": 0.03,  # rad
    "grasp_speed_tolerance": 0.02,  # m/s
}
_FRAME = "handle"


def _plant(
    robot: RobotModel, joints: Array, base: Pose, tick_ns: int = _MS, integrator: str = "rk4"
) -> FreeFloatingPlant:
    """Return a plant whose deputy floats with its only grasp frame at the tool of arm A."""
    tool = robot.tools_in_world(base, joints)["arm_a"]
    frame = Pose(np.array([0.0, 0.1, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    deputy = pose_of(se3_of(tool) * se3_of(frame).inverse())
    initial = InitialState(base, joints, deputy, {_FRAME: frame})
    parameters = replace(load_parameters().plant, integrator=integrator, **_TOLERANCES)
    return FreeFloatingPlant(robot, parameters, initial, tick_ns)


class Drift:
    """The largest departure from each conservation law over a run under random efforts."""

    def __init__(self, robot: RobotModel, integrator: str, tick_ms: int) -> None:
        """Run 0.8 s with the efforts changed at random every 80 ms."""
        draw = Draw(robot, seed=20)
        base, joints = draw.pose(), draw.joints(margin=0.5)
        q = robot.configuration(base, joints)
        efforts = [draw.effort(q) for _ in range(10)]
        plant = _plant(robot, joints, base, tick_ms * _MS, integrator)
        self.start = plant.conserved
        self.worst = np.zeros(4)
        self.moved = 0.0
        for tick in range(800 // tick_ms):
            plant.apply(efforts[tick * tick_ms // 80])
            self._note(plant.conserved, plant.work)
        self.energy = plant.conserved.kinetic_energy

    def _note(self, receipt: ConservedQuantities, work: float) -> None:
        """Keep the largest departures: momenta, centre of mass, energy less work."""
        departures = [
            float(np.linalg.norm(receipt.linear_momentum)),
            float(np.linalg.norm(receipt.angular_momentum)),
            float(np.linalg.norm(receipt.centre_of_mass - self.start.centre_of_mass)),
            abs(receipt.kinetic_energy - work),
        ]
        self.worst = np.maximum(self.worst, departures)


@pytest.mark.parametrize("integrator", sorted(TABLEAUS))
def test_conservation_laws_hold_to_the_order_of_the_integrator(robot: RobotModel, integrator: str) -> None:
    """Momenta, centre of mass and energy less work leave their start only by the integrator's error.

    That error vanishes with the step to the declared power, so nothing else leaks.
    """
    ticks = [2, 4, 8]
    runs = [Drift(robot, integrator, tick) for tick in ticks]
    order = TABLEAUS[integrator].order
    assert runs[0].energy > 0.01  # [J] the robot does move
    for law in range(4):
        measured = slope([float(tick) for tick in ticks], [run.worst[law] for run in runs])
        assert measured == pytest.approx(order, abs=0.1)


def test_conservation_at_the_shipped_tick(robot: RobotModel) -> None:
    """At 1 ms both momenta stay below 1e-9 and energy equals work to 1e-6, even with lively motions."""
    run = Drift(robot, "rk4", 1)
    assert np.max(run.worst[:2]) < 1e-9  # [kg m/s], [kg m^2/s]
    assert run.worst[3] < 1e-6 * run.energy


def test_a_robot_at_rest_without_efforts_stays_as_it_is(robot: RobotModel, draw: Draw) -> None:
    """Nothing moves, but for the rounding of a quaternion that is normalised again and again."""
    plant = _plant(robot, draw.joints(), draw.pose())
    q = plant.state.q
    for _ in range(10):
        plant.apply(np.zeros(14))
    np.testing.assert_allclose(plant.state.q, q, atol=4 * _EPS)
    assert plant.work == 0.0


def test_motion_does_not_depend_on_where_the_base_is(robot: RobotModel, draw: Draw) -> None:
    """A hundred metres from the origin of the world the robot moves as it does there, to rounding."""
    joints, attitude = draw.joints(margin=0.5), draw.pose().quaternion_xyzw
    effort = draw.vector(14, 0.3)  # [N m]
    velocities = []
    for place in (np.zeros(3), np.array([100.0, -100.0, 100.0])):
        plant = _plant(robot, joints, Pose(place, attitude))
        for _ in range(20):
            plant.apply(effort)
        velocities.append(plant.v)
    assert np.max(np.abs(velocities[0])) > 1.0  # [rad/s]
    np.testing.assert_allclose(velocities[1], velocities[0], rtol=0.0, atol=1000 * _EPS)


def test_work_is_effort_times_way(robot: RobotModel, draw: Draw) -> None:
    """The work of a tick is the effort times the way of its joint, summed over the joints."""
    plant = _plant(robot, draw.joints(margin=0.5), draw.pose())
    effort = draw.effort(plant.state.q)
    before = plant.state.joint_position
    plant.apply(effort)
    assert plant.work == pytest.approx(effort @ (plant.state.joint_position - before), rel=16 * _EPS)
    assert plant.work > 0.0


def test_time_is_counted_in_whole_ticks(robot: RobotModel, draw: Draw) -> None:
    """The stamp of state k is k ticks, without any sum of floats."""
    plant = _plant(robot, draw.joints(), draw.pose(), tick_ns=333_333)
    for tick in range(10):
        assert (plant.tick, plant.stamp_ns, plant.state.stamp_ns) == (tick, tick * 333_333, tick * 333_333)
        plant.apply(np.zeros(14))


def test_effort_is_limited_and_the_ticks_are_counted(robot: RobotModel, draw: Draw) -> None:
    """A joint gives what it can and no more: the state reports that effort, and the motion follows it."""
    joints, base = draw.joints(margin=0.5), draw.pose()
    asked, given = np.zeros(14), np.zeros(14)
    asked[1], given[1] = 500.0, robot.effort_limit[1]
    asked[8], given[8] = -500.0, -robot.effort_limit[8]
    asked[3] = given[3] = robot.effort_limit[3]  # a law that stops at the limit is saturated too
    asked[5] = given[5] = np.nextafter(robot.effort_limit[5], 0.0)
    limited, exact = _plant(robot, joints, base), _plant(robot, joints, base)
    for _ in range(3):
        limited.apply(asked)
        exact.apply(given)
    np.testing.assert_array_equal(limited.state.joint_effort, given)
    np.testing.assert_array_equal(limited.state.v, exact.state.v)
    assert limited.work == exact.work
    at_limit = {robot.joint_names[joint]: 3 for joint in (1, 3, 8)}
    assert limited.saturated_ticks == dict.fromkeys(robot.joint_names, 0) | at_limit
    assert exact.saturated_ticks == limited.saturated_ticks


def test_effort_in_a_state_acted_over_the_tick_before(robot: RobotModel, draw: Draw) -> None:
    """The first state has no effort; the state after a command carries that command."""
    plant = _plant(robot, draw.joints(), draw.pose())
    np.testing.assert_array_equal(plant.state.joint_effort, np.zeros(14))
    for _ in range(2):
        effort = draw.vector(14, 0.01)
        plant.apply(effort)
        np.testing.assert_array_equal(plant.state.joint_effort, effort)


def test_reset_repeats_the_run_bit_for_bit(robot: RobotModel, draw: Draw) -> None:
    """After a reset the same commands give the same states, work and deputy as at first."""
    plant = _plant(robot, draw.joints(margin=0.5), draw.pose())
    effort = draw.effort(plant.state.q)
    ends = []
    for _ in range(2):
        plant.reset()
        assert plant.execute((GraspCommand(GraspAction.GRASP, "arm_a", _FRAME),))[0].status is (
            GraspStatus.SUCCEEDED
        )
        for _ in range(20):
            plant.apply(effort)
        state, deputy = plant.state, plant.deputy.deputy_in_world
        ends.append([state.q, state.v, [plant.work], deputy.position])
    for first, second in zip(*ends, strict=True):
        np.testing.assert_array_equal(first, second)
    plant.reset()
    assert (plant.stamp_ns, plant.work, plant.deputy.holder) == (0, 0.0, "")


def test_a_state_does_not_change_afterwards(robot: RobotModel, draw: Draw) -> None:
    """A state that was handed out is a value: integration goes on without touching it."""
    plant = _plant(robot, draw.joints(margin=0.5), draw.pose())
    state = plant.state
    kept = state.q.copy(), state.v.copy()
    for _ in range(5):
        plant.apply(draw.effort(kept[0]))
    np.testing.assert_array_equal(state.q, kept[0])
    np.testing.assert_array_equal(state.v, kept[1])
    with pytest.raises(ValueError, match="read-only"):
        state.joint_position[0] = 1.0


def test_start_outside_a_limit_is_refused(robot: RobotModel) -> None:
    """The message names the joint, its angle and what is allowed."""
    joints = np.zeros(14)
    joints[robot.joint_index("arm_b_joint_4")] = pi
    with pytest.raises(
        ConfigurationError, match=r"arm_b_joint_4 is 3\.14.* rad, must be in \[-2\.57, 2\.57\]"
    ):
        _plant(robot, joints, Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])))


def test_a_held_deputy_moves_with_its_tool(robot: RobotModel, draw: Draw) -> None:
    """Once grasped, the deputy keeps its pose in the tool, and its twist is the rate of its pose."""
    plant = _plant(robot, draw.joints(margin=0.5), draw.pose())
    (event,) = plant.execute((GraspCommand(GraspAction.GRASP, "arm_a", _FRAME),))
    assert event.status is GraspStatus.SUCCEEDED
    assert plant.deputy.holder == "arm_a"
    effort = draw.effort(plant.state.q)
    rows = []
    for _ in range(60):
        deputy, tool = plant.deputy, plant.tools_in_world["arm_a"]
        pose = deputy.deputy_in_world
        relative = pose_of(se3_of(tool).inverse() * se3_of(pose))
        rows.append((np.concatenate([pose.position, pose.quaternion_xyzw]), deputy, relative))
        plant.apply(effort)
    for _, _, relative in rows[1:]:
        # a dozen operations on numbers below 3 per matrix product, three products
        assert max(pose_distance(relative, rows[0][2])) <= 3 * 12 * 3 * _EPS
    tick = ns_to_seconds(_MS)
    before, (_, middle, _), after = rows[-3], rows[-2], rows[-1]
    velocity = (after[0][:3] - before[0][:3]) / (2.0 * tick)
    turned = row_distance(before[0], after[0])[1] / (2.0 * tick)
    # h^2 / 6 times the third derivative: joint rates below 1 rad/s at 8 axes, accelerations below 10 rad/s^2
    bound = tick**2 / 6.0 * 8.0 * (1.0 + 3.0 * 10.0 + 100.0)
    assert np.linalg.norm(middle.twist_deputy_in_world.linear) > 100 * bound
    np.testing.assert_allclose(middle.twist_deputy_in_world.linear, velocity, atol=bound)
    assert np.linalg.norm(middle.twist_deputy_in_world.angular) == pytest.approx(turned, abs=bound)


def test_a_deputy_let_go_flies_straight_on(robot: RobotModel, draw: Draw) -> None:
    """Released in motion, its origin keeps the velocity it had, whatever the robot does then."""
    plant = _plant(robot, draw.joints(margin=0.5), draw.pose())
    plant.execute((GraspCommand(GraspAction.GRASP, "arm_a", _FRAME),))
    effort = draw.effort(plant.state.q)
    for _ in range(50):
        plant.apply(effort)
    plant.execute((GraspCommand(GraspAction.RELEASE, "arm_a"),))
    start, twist = plant.deputy.deputy_in_world, plant.deputy.twist_deputy_in_world
    assert np.linalg.norm(twist.linear) > 1e-3
    for _ in range(100):
        plant.apply(-effort)
    end = plant.deputy
    rounding = 100 * 4 * _EPS
    np.testing.assert_allclose(
        end.deputy_in_world.position, start.position + 0.1 * twist.linear, atol=rounding
    )
    angle = pose_distance(start, end.deputy_in_world)[1]
    assert angle == pytest.approx(0.1 * np.linalg.norm(twist.angular), abs=rounding)
    np.testing.assert_array_equal(end.twist_deputy_in_world.linear, twist.linear)


def test_a_missed_grasp_leaves_the_deputy_alone(robot: RobotModel, draw: Draw) -> None:
    """Arm B is far away: its grasp misses, says by how much, and the deputy floats on."""
    plant = _plant(robot, draw.joints(), draw.pose())
    before = plant.deputy.deputy_in_world
    (event,) = plant.execute((GraspCommand(GraspAction.GRASP, "arm_b", _FRAME),))
    tools = plant.tools_in_world
    expected = pose_distance(tools["arm_a"], tools["arm_b"])  # the grasp frame is at the tool of arm A
    assert event.status is GraspStatus.MISSED
    assert (event.position_error, event.angle_error) == pytest.approx(expected, abs=1e-14)
    assert plant.deputy.holder == ""
    np.testing.assert_array_equal(plant.deputy.deputy_in_world.position, before.position)


def test_a_deputy_without_mass_does_not_disturb_the_robot(robot: RobotModel, draw: Draw) -> None:
    """The robot moves bit for bit alike with and without the deputy in its hand."""
    joints, base = draw.joints(margin=0.5), draw.pose()
    free, holding = _plant(robot, joints, base), _plant(robot, joints, base)
    holding.execute((GraspCommand(GraspAction.GRASP, "arm_a", _FRAME),))
    effort = draw.effort(robot.configuration(base, joints))
    for _ in range(20):
        for plant in (free, holding):
            plant.apply(effort)
    np.testing.assert_array_equal(free.state.q, holding.state.q)
    np.testing.assert_array_equal(free.state.v, holding.state.v)


def test_no_commands_no_events(robot: RobotModel, draw: Draw) -> None:
    """Nothing asked, nothing answered."""
    assert _plant(robot, draw.joints(), draw.pose()).execute(()) == ()
