"""The loop in one process: a handover that completes, conserves what it must, and repeats bit for bit."""

from dataclasses import fields, replace

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.errors import ConfigurationError, UnstableLoopError
from sms_handover.graph.events import GRASP_FAILED, GRASP_MISSED, IK_FAILED, PHASE_RETRIED
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.model.poses import pose_of, pose_row, se3_of
from sms_handover.model.reduced import base_twist_per_joint_rate, reduced_dynamics
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import initial_joints
from sms_handover.types import Array, GraspStatus, IkStatus, Pose, TaskPhase

from .conftest import SCHEDULE, MakeScenario, row_distance, run

_EPS = np.finfo(float).eps
_ROUNDING = 3 * 12 * 3 * _EPS
_TICK_NS, _PERIOD_NS = 1_000_000, 20_000_000


def _pose(row: Array) -> Pose:
    """Return the pose of a row."""
    return Pose(row[:3], row[3:])


def _assert_equal(a: RunData, b: RunData) -> None:
    """Assert that two runs are the same in every bit of every field."""
    for item in fields(RunData):
        left, right = getattr(a, item.name), getattr(b, item.name)
        if isinstance(left, np.ndarray):
            assert left.tobytes() == right.tobytes(), item.name
        elif item.name in ("target_pose", "tool_pose"):
            assert list(left) == list(right)
            assert all(left[arm].tobytes() == right[arm].tobytes() for arm in left), item.name
        else:
            assert repr(left) == repr(right), item.name  # events hold NaN, which equals nothing


# --- shape and meaning of a record ---------------------------------------------------------------


@pytest.fixture(scope="module")
def short() -> RunData:
    """The first 0.3 s of the shipped handover."""
    return run(common={"duration": 0.3})


def test_a_run_of_n_ticks_has_n_plus_one_states(short: RunData, scenario: Scenario) -> None:
    """From the initial state to the last, one row each; a row per reference period, both ends included."""
    robot, n, m = scenario.truth.robot, 301, 16
    assert (short.joint_names, short.arms) == (robot.joint_names, robot.arms)
    np.testing.assert_array_equal(short.tick_ns, np.arange(n) * _TICK_NS)
    np.testing.assert_array_equal(short.reference_ns, np.arange(m) * _PERIOD_NS)
    shapes = {
        **dict.fromkeys(("joint_position", "joint_velocity", "joint_effort", "joint_command"), (n, 14)),
        **dict.fromkeys(("reference_position", "reference_velocity"), (m, 14)),
        **dict.fromkeys(("linear_momentum", "angular_momentum"), (m, 3)),
        **dict.fromkeys(("kinetic_energy", "work", "ik_status"), (m,)),
        "base_pose": (n, 7),
        "base_twist": (n, 6),
        "deputy_pose": (m, 7),
    }
    assert {name: getattr(short, name).shape for name in shapes} == shapes
    for poses in (short.target_pose, short.tool_pose):
        assert {arm: rows.shape for arm, rows in poses.items()} == dict.fromkeys(robot.arms, (m, 7))
    assert len(short.phases) == m
    for item in fields(RunData):
        value = getattr(short, item.name)
        if isinstance(value, np.ndarray):
            assert np.all(np.isfinite(value)), item.name


def test_a_duration_between_two_periods(scenario: Scenario) -> None:
    """Every tick up to the end is there, and every reference period that has begun."""
    data = run(common={"duration": 0.0305})
    assert (data.tick_ns[-1], data.reference_ns[-1]) == (30 * _TICK_NS, _PERIOD_NS)


def test_a_run_begins_at_rest_where_the_schedule_says(short: RunData, scenario: Scenario) -> None:
    """The first row is the initial state: at rest, without effort, with the deputy in its place."""
    schedule = scenario.truth.schedule
    np.testing.assert_array_equal(short.joint_position[0], initial_joints(scenario.truth.robot, schedule))
    np.testing.assert_array_equal(short.base_pose[0], pose_row(schedule.base_in_world))
    for values in (short.joint_velocity, short.joint_effort, short.base_twist, short.work):
        assert not np.any(values[0])
    assert max(row_distance(short.deputy_pose[0], pose_row(schedule.deputy.deputy_in_world))) <= _ROUNDING


def test_a_command_acts_over_the_tick_that_follows_its_state(short: RunData, scenario: Scenario) -> None:
    """The effort in state k + 1 is the command that answers state k, as far as the joints can give it."""
    limit = scenario.truth.robot.effort_limit
    np.testing.assert_array_equal(short.joint_effort[1:], np.clip(short.joint_command[:-1], -limit, limit))
    assert np.any(short.joint_command[0])


def test_poses_of_the_record_belong_to_its_states(short: RunData, scenario: Scenario) -> None:
    """The tool poses of a period are those of the state of the same stamp."""
    per_period = _PERIOD_NS // _TICK_NS
    for row in range(0, len(short.reference_ns), 5):
        base = _pose(short.base_pose[row * per_period])
        tools = scenario.truth.robot.tools_in_world(base, short.joint_position[row * per_period])
        for arm, tool in tools.items():
            np.testing.assert_array_equal(short.tool_pose[arm][row], pose_row(tool))


def test_a_record_cannot_be_changed(short: RunData) -> None:
    """Neither its arrays nor its mappings."""
    with pytest.raises(ValueError, match="read-only"):
        short.joint_position[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        short.tool_pose["arm_a"][0, 0] = 1.0
    with pytest.raises(TypeError):
        short.tool_pose["arm_a"] = short.deputy_pose  # type: ignore[index]


def test_progress_is_told_every_period(make_scenario: MakeScenario) -> None:
    """With the time and the phase, as the run goes on."""
    told: list[tuple[int, str]] = []

    def progress(time_ns: int, phase: TaskPhase) -> None:
        told.append((time_ns, phase.name))

    data = simulate(make_scenario(common={"duration": 0.5}), progress=progress)
    assert told == [(stamp, "approach" if stamp < 400_000_000 else "carry") for stamp in data.reference_ns]


def test_a_run_ends_where_it_is_asked_to(make_scenario: MakeScenario) -> None:
    """With what was carried out before; until then it is the run that goes on."""
    scenario = make_scenario(common={"duration": 0.2})
    ended = simulate(scenario, until=lambda ticks: ticks.rows.stamp_ns[-1] >= 90_000_000)
    assert ended.tick_ns[-1] == 99_000_000
    assert compare_runs(ended, before(simulate(scenario), 100_000_000)) == ()


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_every_command_follows_from_the_record(make_scenario: MakeScenario, law: str) -> None:
    """Each command is the law's formula on the recorded state and reference, with the gains of its phase.

    Between two references the desired motion goes on with constant acceleration, which is the
    difference of the last two reference velocities, but for the first reference of a phase.
    """
    scenario = make_scenario(controller={"law": law}, trajectory={"time_law": "quintic"})
    robot, data, gains = scenario.truth.robot, simulate(scenario), scenario.parameters.controller
    integral = np.zeros(14)
    for tick in range(len(data.tick_ns)):
        row, since = tick // 20, (tick % 20) * 1e-3
        index = data.phases[row].index
        fresh = row == 0 or data.phases[row - 1].index != index
        velocity = data.reference_velocity[row]
        acceleration = np.zeros(14) if fresh else (velocity - data.reference_velocity[row - 1]) / 0.02
        desired = data.reference_position[row] + velocity * since + acceleration * since**2 / 2.0
        error = data.joint_position[tick] - desired
        rate = data.joint_velocity[tick] - velocity - acceleration * since
        if law == "pid":
            effort = -(gains.proportional * error + gains.integral * integral + gains.derivative * rate)
            integral += error * 1e-3
        else:
            period = 2.0 if index == 1 else gains.rolling_period
            wanted = acceleration - 10.0 / 3.0 / period**2 * error - 5.0 / 2.0 / period * rate
            base, twist = data.base_pose[tick], data.base_twist[tick]
            q = np.concatenate([base, data.joint_position[tick]])
            v = np.concatenate([twist, data.joint_velocity[tick]])
            dynamics = reduced_dynamics(robot, q, v)
            effort = dynamics.inertia @ wanted + dynamics.bias
        effort = np.clip(effort, -robot.effort_limit, robot.effort_limit)
        # a difference of velocities below 1 over 20 ms, through an inertia below 3; and the integral's sum
        bound = 14 * 3.0 * _EPS / 0.02 + 1400 * _EPS
        np.testing.assert_allclose(data.joint_command[tick], effort, atol=bound)
    assert np.max(np.abs(data.reference_velocity)) > 0.01


# --- repeatability -------------------------------------------------------------------------------


def test_the_same_scenario_gives_the_same_bits(short: RunData, make_scenario: MakeScenario) -> None:
    """Twice from new objects, and twice from the same ones after another run in between."""
    _assert_equal(short, run(common={"duration": 0.3}))
    scenario = make_scenario()
    first = simulate(scenario)
    other = replace(scenario, parameters=load_scenario("colliding", {"law": "pid"}).parameters)
    simulate(replace(other, parameters=replace(other.parameters, common=scenario.parameters.common)))
    _assert_equal(first, simulate(scenario))


def test_a_longer_run_begins_like_a_short_one(short: RunData, nmpc_run: RunData) -> None:
    """Nothing that comes later changes what came before."""
    n, m = len(short.tick_ns), len(short.reference_ns)
    assert short.joint_position.tobytes() == nmpc_run.joint_position[:n].tobytes()
    assert short.joint_command.tobytes() == nmpc_run.joint_command[:n].tobytes()
    assert short.base_pose.tobytes() == nmpc_run.base_pose[:n].tobytes()
    assert short.target_pose["arm_a"].tobytes() == nmpc_run.target_pose["arm_a"][:m].tobytes()


# --- the whole handover, under each law ----------------------------------------------------------


def test_the_handover_completes(handover: RunData, scenario: Scenario) -> None:
    """A grasps the deputy by a third of the time and B takes it at two thirds, inside every tolerance."""
    tolerance = scenario.parameters.plant.grasp_tolerance
    commands = [command for phase in scenario.truth.schedule.phases for command in phase.commands]
    assert [event.command for event in handover.grasp_events] == commands
    for event in handover.grasp_events:
        assert event.status is GraspStatus.SUCCEEDED
        assert event.position_error <= tolerance.position
        assert event.angle_error <= tolerance.angle
        assert event.relative_speed <= tolerance.speed


def test_the_tool_ends_at_its_target(nmpc_run: RunData) -> None:
    """Arm B's tool is within a millimetre of its final pose under NMPC."""
    assert row_distance(nmpc_run.tool_pose["arm_b"][-1], nmpc_run.target_pose["arm_b"][-1])[0] < 1e-3


def test_momentum_is_conserved(handover: RunData) -> None:
    """No joint effort can set the whole in motion or spin it: both momenta stay below 1e-9."""
    assert np.max(np.abs(handover.linear_momentum)) < 1e-9  # [kg m/s]
    assert np.max(np.abs(handover.angular_momentum)) < 1e-9  # [kg m^2/s]


def test_energy_is_the_work_of_the_joints(handover: RunData) -> None:
    """What the joints have given is in the motion, to 1e-6 of the largest energy: there is no damping."""
    largest = np.max(handover.kinetic_energy)
    assert largest > 0.0
    np.testing.assert_allclose(handover.kinetic_energy, handover.work, atol=1e-6 * largest)


def test_work_is_the_sum_of_effort_times_way(handover: RunData) -> None:
    """The work of the record is that of the recorded efforts over the recorded ways."""
    ways = np.diff(handover.joint_position, axis=0)
    work = np.concatenate([[0.0], np.cumsum(np.sum(handover.joint_effort[1:] * ways, axis=1))])
    # each of up to 60 000 terms is known to eps times its effort times an angle below 3
    bound = len(work) * 14 * 3.0 * _EPS * float(np.max(np.abs(handover.joint_effort)))
    np.testing.assert_allclose(handover.work, work[:: _PERIOD_NS // _TICK_NS], atol=bound)


def test_the_centre_of_mass_stays(handover: RunData, scenario: Scenario) -> None:
    """Whatever the arms do, it does not leave its place by more than a momentum of 1e-9 allows."""
    robot = scenario.truth.robot
    places = []
    for row in range(0, len(handover.tick_ns), 2000):
        q = robot.configuration(_pose(handover.base_pose[row]), handover.joint_position[row])
        places.append(np.array(pin.centerOfMass(robot.pin, robot.data, q)))
    duration = float(handover.tick_ns[-1]) * 1e-9
    bound = 1e-9 / robot.mass * duration + 21 * _EPS
    np.testing.assert_allclose(places, np.broadcast_to(places[0], (len(places), 3)), atol=bound)


def test_the_base_moves_as_the_joints_make_it(handover: RunData, scenario: Scenario) -> None:
    """At zero momentum its twist is -H_b^-1 H_bm times the joint rates, at every instant."""
    robot = scenario.truth.robot
    for row in range(0, len(handover.tick_ns), 2500):
        q = robot.configuration(_pose(handover.base_pose[row]), handover.joint_position[row])
        expected = base_twist_per_joint_rate(robot, q) @ handover.joint_velocity[row]
        # the momentum of 1e-9 over the base's least inertia, 40 kg m^2, at arms of 1 m
        np.testing.assert_allclose(handover.base_twist[row], expected, atol=2.0 * 1e-9 / 40.0)


def test_the_base_orientation_stays_a_unit_quaternion(handover: RunData) -> None:
    """Over 60 000 ticks it does not leave the sphere."""
    np.testing.assert_allclose(np.linalg.norm(handover.base_pose[:, 3:], axis=1), 1.0, atol=4 * _EPS)


def test_the_deputy_stays_until_it_is_grasped_and_then_goes_along(
    handover: RunData, scenario: Scenario
) -> None:
    """At rest in its place at first; then rigid in the tool of the arm that holds it."""
    grasp, transfer = (event.stamp_ns for event in handover.grasp_events)
    rows = {
        "": handover.reference_ns < grasp,
        "arm_a": (handover.reference_ns > grasp) & (handover.reference_ns < transfer),
        "arm_b": handover.reference_ns > transfer,
    }
    free = handover.deputy_pose[rows[""]]
    # drift() multiplies the rotation by one at every tick
    np.testing.assert_allclose(free, np.broadcast_to(free[0], free.shape), atol=len(free) * 20 * _EPS)
    for arm in ("arm_a", "arm_b"):
        pairs = zip(handover.tool_pose[arm][rows[arm]], handover.deputy_pose[rows[arm]], strict=True)
        relative = [pose_row(pose_of(se3_of(_pose(t)).actInv(se3_of(_pose(d))))) for t, d in pairs]
        assert max(max(row_distance(relative[0], row)) for row in relative) <= 2 * _ROUNDING


def test_inverse_kinematics_converged_throughout(handover: RunData) -> None:
    """Every target of the shipped schedule is in reach, from where the arms are, all of the time."""
    assert set(handover.ik_status.tolist()) == {CONSTANTS[IkStatus.CONVERGED]}


# --- what goes wrong -----------------------------------------------------------------------------


def test_a_missed_grasp_is_told_and_the_run_goes_on(make_scenario: MakeScenario) -> None:
    """An arm that has not arrived misses; the transfer and release that follow are rejected."""
    data = simulate(make_scenario())
    statuses = [event.status for event in data.grasp_events]
    assert statuses == [GraspStatus.MISSED, GraspStatus.REJECTED, GraspStatus.REJECTED]
    assert [event.stamp_ns for event in data.grasp_events] == [400_000_000, 1_000_000_000, 1_200_000_000]
    assert data.tick_ns[-1] == 1_400_000_000
    assert max(row_distance(data.deputy_pose[0], data.deputy_pose[-1])) <= 1400 * _ROUNDING


RETRY = SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: {retry: 5}\n")
ABORT = SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: abort\n")
FASTER: dict[str, object] = {"rolling_period": 0.3}  # s: the first approach is still too fast


def test_a_retry_mends_a_miss_and_the_run_is_longer(make_scenario: MakeScenario) -> None:
    """The approach is done again from 0.42 s, when the miss is known; what follows is later by that."""
    data = simulate(make_scenario(RETRY, controller=FASTER))
    grasps = [event for event in data.grasp_events if event.command.arm == "arm_a"]
    assert [(e.stamp_ns, e.status) for e in grasps] == [
        (400_000_000, GraspStatus.MISSED),
        (820_000_000, GraspStatus.SUCCEEDED),
    ]
    assert (data.run_events[0].kind, data.run_events[0].stamp_ns) == (PHASE_RETRIED, 420_000_000)
    assert data.tick_ns[-1] == 1_820_000_000
    np.testing.assert_array_equal(data.tick_ns, np.arange(1821) * _TICK_NS)
    np.testing.assert_array_equal(data.reference_ns, np.arange(92) * _PERIOD_NS)
    for item in fields(RunData):
        value = getattr(data, item.name)
        if isinstance(value, np.ndarray):
            assert np.all(np.isfinite(value)), item.name


def test_until_it_is_known_that_a_grasp_missed_the_policy_changes_no_bit(make_scenario: MakeScenario) -> None:
    plain = simulate(make_scenario(controller=FASTER))
    again = simulate(make_scenario(RETRY, controller=FASTER))
    known = 420  # [ticks]; the command of that tick is the first that can differ
    for name in ("joint_position", "joint_velocity", "joint_effort", "base_pose", "base_twist"):
        one, other = getattr(plain, name), getattr(again, name)
        assert one[: known + 1].tobytes() == other[: known + 1].tobytes(), name
    assert plain.joint_command[:known].tobytes() == again.joint_command[:known].tobytes()
    assert plain.joint_command[known].tobytes() != again.joint_command[known].tobytes()


def test_an_aborted_task_holds_the_joints_and_ends(make_scenario: MakeScenario) -> None:
    """Their reference is where they were when the miss was known, without a jump of the desired rates."""
    data = simulate(make_scenario(ABORT, trajectory={"failure_hold": 0.5}))
    assert data.tick_ns[-1] == 920_000_000
    assert [event.kind for event in data.run_events] == [GRASP_FAILED]
    assert data.phases[-1].failed and not data.phases[20].failed
    held = data.reference_position[data.reference_ns >= 420_000_000]
    np.testing.assert_array_equal(held, np.tile(data.joint_position[420], (len(held), 1)))
    assert not np.any(data.reference_velocity[data.reference_ns >= 420_000_000])
    speed = np.abs(data.joint_velocity).max(axis=1)
    assert speed[-1] < 0.5 * speed[420]


def test_a_duration_that_is_given_holds_whatever_is_done_again(make_scenario: MakeScenario) -> None:
    """But a task that has failed ends before it."""
    longer: dict[str, object] = {"duration": 2.5}
    assert simulate(make_scenario(RETRY, common=longer, controller=FASTER)).tick_ns[-1] == 2_500_000_000
    hold: dict[str, object] = {"failure_hold": 0.1}
    assert simulate(make_scenario(ABORT, common=longer, trajectory=hold)).tick_ns[-1] == 520_000_000


def test_targets_out_of_reach_for_long_fail_the_phase(make_scenario: MakeScenario) -> None:
    far = SCHEDULE.replace("xyz: [1.15, 0.02, 0.75]", "xyz: [4.0, 0.02, 0.75]")
    data = simulate(make_scenario(far, trajectory={"ik_failures": 5, "failure_hold": 0.0}))
    assert [event.kind for event in data.run_events] == [GRASP_MISSED, IK_FAILED]
    assert data.tick_ns[-1] == 500_000_000  # from 0.4 s on, 5 periods


def test_no_inverse_kinematics_where_no_tool_has_a_target(make_scenario: MakeScenario) -> None:
    """While both arms are led by their joints nothing is asked, and the record says so."""
    text = SCHEDULE[: SCHEDULE.index("  - name: carry")].replace("{grasp_frame: left}", "hold")
    data = simulate(make_scenario(text))
    assert set(data.ik_status.tolist()) == {-1}
    # at rest, on hold: rounding of H^-1 c* only, over 0.4 s
    np.testing.assert_allclose(data.joint_position, np.tile(data.joint_position[0], (401, 1)), atol=1e-12)


def test_an_unreachable_target_does_not_stop_the_run(make_scenario: MakeScenario) -> None:
    """The loop goes on with the nearest pose, and the record says in every period that it is not met."""
    far = SCHEDULE.replace("xyz: [1.15, 0.02, 0.75]", "xyz: [4.0, 0.02, 0.75]")
    assert far != SCHEDULE
    data = simulate(make_scenario(far, common={"duration": 0.6}))
    carry = data.ik_status[data.reference_ns >= 400_000_000]
    assert CONSTANTS[IkStatus.CONVERGED] not in set(carry.tolist())
    assert np.all(np.isfinite(data.joint_command))


def test_unusable_scenarios_are_refused_before_a_tick(make_scenario: MakeScenario) -> None:
    """A loop that diverges, and gains that do not exist."""
    with pytest.raises(UnstableLoopError):
        simulate(make_scenario(common={"tick": 0.002}, controller={"law": "pid"}))
    with pytest.raises(ConfigurationError, match="gains of phase 'carry'"):
        simulate(make_scenario(SCHEDULE.replace("rolling_period: 2.0", "rolling_period: -2.0")))
