"""The balancer of the examples: its program against another solver, hard bounds, and what the base does."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from balancer.gains import Gains
from balancer.law import Balancer
from balancer.motion import Motion, expected
from balancer.program import Program
from scipy.optimize import nnls

from sms_handover.analysis.signals import base_rotation
from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.control.law import LawSetup
from sms_handover.control.protocol import Guidance
from sms_handover.model.known_payload import Grip, KnownPayload
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.reduced import base_twist_per_joint_rate
from sms_handover.plan_report import PlanStatus
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.run_data import RunData
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import initial_joints, make_clearance
from sms_handover.trajectory.preview import TargetPreview
from sms_handover.trajectory.schedule import JointTarget
from sms_handover.types import (
    BASE_NQ,
    BASE_NV,
    Array,
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    JointReference,
    PhaseState,
    TaskPhase,
    Twist,
)

from .laws import offer

H = 0.02  # [s] a reference period
STILL = Twist(np.zeros(3), np.zeros(3))


@pytest.fixture(scope="module")
def smooth() -> Scenario:
    return load_scenario("smooth", {"deputy.mass": 4.0})


def start(scenario: Scenario) -> Array:
    """Return the configuration that a scenario begins with."""
    robot, schedule = scenario.model.robot, scenario.model.schedule
    return robot.configuration(schedule.base_in_world, initial_joints(robot, schedule))


def law_of(scenario: Scenario, *, moved: bool = False, **gains: float) -> Balancer:
    """Return the law where it has heard of its first phase, in which joint references move or stand still."""
    robot, schedule = scenario.model.robot, scenario.model.schedule
    law = Balancer(
        LawSetup(
            robot,
            (Gains(**gains),) * len(schedule.phases),
            1_000_000,
            None,
            deputy=schedule.deputy,
            preview=TargetPreview(robot, schedule),
            distances=NearPairs(make_clearance(robot, schedule)),
        )
    )
    joints, still = initial_joints(robot, schedule), np.zeros(robot.n_joints)
    phase = TaskPhase(0, 0, schedule.phases[0].name)
    for shift in (0.0, 0.1 if moved else 0.0):
        law.guide(Guidance(phase, JointReference(0, joints + shift, still), robot.tools_at(start(scenario))))
    return law


def targets_of(scenario: Scenario, shift: Array, holder: str = "") -> PreviewedTargets:
    """Return targets: the tool of arm A is to be elsewhere, the joints of B where they are."""
    robot, deputy = scenario.model.robot, scenario.model.schedule.deputy
    tool = se3_of(robot.tools_at(start(scenario))["arm_a"])
    goal = pose_of(pin.SE3(tool.rotation, tool.translation + shift))
    joints = initial_joints(robot, scenario.model.schedule)
    return PreviewedTargets(
        {"arm_a": goal},
        {"arm_a": STILL},
        joints,
        0.0 * joints,
        holder,
        deputy.deputy_in_world,
        frozenset(),
    )


def motion_at(scenario: Scenario, q: Array, rates: Array) -> Motion:
    """Return the motion of a robot without momentum."""
    robot = scenario.model.robot
    v = np.concatenate([base_twist_per_joint_rate(robot, q) @ rates, rates])
    return expected(robot, q, v, q[BASE_NQ:], rates, H)


def independent(program: Program) -> Array:
    """Return the minimum by Lawson's and Hanson's least distance: NNLS for the dual of a dense problem."""
    root = np.linalg.cholesky(program.hessian)
    centre = -np.linalg.solve(program.hessian, program.gradient)
    rows = np.vstack([np.eye(centre.size), program.matrix])
    every, bounds = np.vstack([rows, -rows]), np.concatenate([program.low, -program.high])
    finite = np.isfinite(bounds)
    least = every[finite] @ np.linalg.inv(root.T)
    far = bounds[finite] - every[finite] @ centre
    system, aim = np.vstack([least.T, far]), np.append(np.zeros(centre.size), 1.0)
    weights, size = nnls(system, aim, maxiter=1000)
    assert size > 0.0  # it is feasible
    rest = system @ weights - aim
    return np.asarray(centre + np.linalg.inv(root.T) @ (-rest[:-1] / rest[-1]))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rates_are_those_of_an_independent_solve(smooth: Scenario, seed: int) -> None:
    """With bounds of all kinds that bind; multipliers have the right signs and only where bounds bind."""
    random = np.random.default_rng(seed)
    law, q = law_of(smooth, keep_apart=0.12), start(smooth)
    gains = Gains(arm_rate_limit=0.05, keep_apart=0.12)
    target = targets_of(smooth, random.uniform(-0.3, 0.3, 3))
    program = law.program(gains, motion_at(smooth, q, random.uniform(-0.05, 0.05, 14)), target)
    found = program.solve()
    np.testing.assert_allclose(found.rates, independent(program), rtol=0.0, atol=1e-9)
    assert found.residual < 1e-9 and len(found.active) > 1
    values = np.concatenate([found.rates, program.matrix @ found.rates])
    assert (values <= program.high + 1e-9).all() and (values >= program.low - 1e-9).all()
    upper, lower = found.multipliers > 0.0, found.multipliers < 0.0
    np.testing.assert_allclose(values[upper], program.high[upper], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(values[lower], program.low[lower], rtol=0.0, atol=1e-9)


def test_without_bounds_the_rates_are_the_closed_form(smooth: Scenario) -> None:
    program = Program(smooth.model.robot.joint_names)
    random = np.random.default_rng(1)
    rows, wanted, weights = random.normal(size=(20, 14)), random.normal(size=20), random.uniform(1.0, 9.0, 20)
    program.add(rows, wanted, weights)
    root = np.sqrt(weights)
    best = np.linalg.lstsq(root[:, None] * rows, root * wanted, rcond=None)[0]
    np.testing.assert_allclose(program.solve().rates, best, rtol=1e-10)


def test_bounds_that_contradict_each_other_are_told_by_name(smooth: Scenario) -> None:
    program = Program(smooth.model.robot.joint_names)
    program.add(np.eye(14), np.zeros(14), 1.0)
    program.bound(np.full(14, -0.1), np.full(14, 0.1))
    program.keep(["distance one", "distance other"], np.eye(14)[:2], np.array([-1.0, 0.3]))
    found = program.solve()
    assert (found.status, found.row) == (PlanStatus.INFEASIBLE, "distance other")
    assert found.excess == pytest.approx(0.1, rel=0.01)  # the same for both rows that contradict


def carried_on(scenario: Scenario, law: Balancer, gains: Gains, target: PreviewedTargets) -> Iterator[Array]:
    """Yield configurations and rates (7 + 2 n,) as the joints follow the program for three seconds."""
    robot, q = scenario.model.robot, start(scenario)
    rates = np.zeros(robot.n_joints)
    for _ in range(150):
        found = law.program(gains, motion_at(scenario, q, rates), target).solve()
        assert found.status is PlanStatus.SOLVED
        mean = 0.5 * (rates + found.rates)
        half = np.concatenate([base_twist_per_joint_rate(robot, q) @ mean, mean])
        middle = pin.integrate(robot.pin, q, 0.5 * H * half)
        v = np.concatenate([base_twist_per_joint_rate(robot, middle) @ mean, mean])
        q, rates = pin.integrate(robot.pin, q, H * v), found.rates
        yield np.concatenate([q, rates])


def test_no_bound_of_distances_and_rates_is_passed(smooth: Scenario) -> None:
    """Arm A is sent into the gripper of B, which gives way and stays as far off as it has to."""
    gains, n = Gains(keep_apart=0.05, arm_rate_limit=0.4), smooth.model.robot.n_joints
    law = law_of(smooth, keep_apart=0.05)
    tools = smooth.model.robot.tools_at(start(smooth))
    target = targets_of(smooth, tools["arm_b"].position - tools["arm_a"].position)
    model = make_clearance(smooth.model.robot, smooth.model.schedule)
    counted = np.array([not one.arm or one.arm != other.arm for one, other in model.pairs])
    least, fastest = np.inf, 0.0
    for row in carried_on(smooth, law, gains, target):
        apart = model.distances(row[:-n], smooth.model.schedule.deputy.deputy_in_world)[counted]
        least, fastest = min(least, float(apart.min())), max(fastest, float(np.abs(row[-n:]).max()))
    assert 0.05 - 1e-4 < least < 0.055
    assert fastest == pytest.approx(0.4, abs=1e-9)


def test_no_limit_of_a_joint_is_passed(smooth: Scenario) -> None:
    """Joints that are led far beyond their limits come to them, and stay within."""
    robot = smooth.model.robot
    beyond = np.array(start(smooth)[BASE_NQ:])
    up, down = (np.array([robot.joint_index(f"{arm}_joint_{k}") for arm in robot.arms]) for k in (4, 2))
    beyond[up], beyond[down] = robot.upper[up] + 1.0, robot.lower[down] - 1.0
    target = replace(targets_of(smooth, np.zeros(3)), tool_in_world={}, joint_position=beyond)
    law, n = law_of(smooth, moved=True), robot.n_joints
    for row in carried_on(smooth, law, Gains(base_turn_weight=0.0, keep_apart=0.0), target):
        joints = row[BASE_NQ:-n]
        assert (joints < robot.upper).all() and (joints > robot.lower).all()
    assert (robot.upper - joints)[up].max() < 0.02 and (joints - robot.lower)[down].max() < 0.02


@pytest.mark.parametrize("why", ["idle", "held", "holds", "moves", "failed"])
def test_only_an_idle_arm_balances(smooth: Scenario, why: str) -> None:
    """Arm B takes part unless the weight is nil, it holds the deputy or is led, or the task has failed."""
    gains = Gains(base_turn_weight=0.0 if why == "held" else 1e6)
    law = law_of(smooth, moved=why == "moves")
    target = targets_of(smooth, np.array([0.0, 0.0, 0.02]), "arm_b" if why == "holds" else "")
    motion = motion_at(smooth, start(smooth), np.zeros(14))
    rates = law.program(gains, motion, target, failed=why == "failed").solve().rates
    parts = slice(0, 14), slice(0, 7)
    turn, alone = (np.linalg.norm(motion.reaction[3:, part] @ rates[part]) for part in parts)
    if why == "idle":
        assert turn < 0.5 * alone
    else:
        assert np.abs(rates[7:]).max() < 0.02 * np.abs(rates[:7]).max()


def test_the_expected_motion_has_the_momentum_of_the_state(smooth: Scenario) -> None:
    """With momentum: the twist of the base follows from the rates, and the robot moves on by it."""
    robot, random = smooth.model.robot, np.random.default_rng(4)
    q, v = start(smooth), 0.1 * random.normal(size=20)
    motion = expected(robot, q, v, q[BASE_NQ:], v[BASE_NV:], 1e-9)
    np.testing.assert_allclose(motion.drift + motion.reaction @ v[BASE_NV:], v[:BASE_NV], atol=1e-9)
    later = expected(robot, q, v, q[BASE_NQ:], v[BASE_NV:], H)
    np.testing.assert_allclose(later.q, pin.integrate(robot.pin, q, H * v), atol=1e-12)


def test_idle_arms_take_over_the_momentum_of_the_base(smooth: Scenario) -> None:
    """A base that turns by its momentum is slowed down, as far as the changes of rates in one period go."""
    robot, q, law = smooth.model.robot, start(smooth), law_of(smooth)
    v = np.zeros(robot.pin.nv)
    v[3:BASE_NV] = [0.002, -0.001, 0.0015]  # rad/s
    motion = expected(robot, q, v, q[BASE_NQ:], v[BASE_NV:], H)
    target = replace(targets_of(smooth, np.zeros(3)), tool_in_world={})
    rates = law.program(Gains(base_turn_weight=1e8), motion, target).solve().rates
    turns = motion.drift[3:] + motion.reaction[3:] @ rates
    assert np.linalg.norm(turns) < 0.01 * np.linalg.norm(motion.drift[3:])


def test_a_payload_counts_from_the_state_after_its_event(smooth: Scenario) -> None:
    """Efforts are those of the robot with the deputy in its hand, as is the reaction of the base."""
    law, q = law_of(smooth), start(smooth)
    v = np.zeros(20)
    v[BASE_NV:] = 0.1
    command = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
    bare = law.effort(0, q, v)
    law.grasped(GraspEvent(0, command, GraspStatus.SUCCEEDED, 0.0, 0.0, 0.0, ""))
    loaded = KnownPayload(smooth.model.robot, smooth.model.schedule.deputy)
    loaded.hold(Grip("arm_a", "end_a"))
    feedback = np.repeat([[40.0], [12.0]], 14, axis=1)
    assert law.setpoint is not None
    for stamp_ns, robot in ((0, smooth.model.robot), (1_000_000, loaded.robot)):
        wanted = robot.limited(ComputedTorque(robot)(q, v, law.setpoint.at(stamp_ns), feedback))
        np.testing.assert_allclose(law.effort(stamp_ns, q, v), wanted, atol=1e-12)
    assert np.abs(law.effort(1_000_000, q, v) - bare).max() > 1e-3


def test_the_base_turns_less_than_with_the_idle_arm_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By name, as any law: a third of the turn at most, with the tool where it is to be."""
    monkeypatch.syspath_prepend(str(offer(tmp_path, "balancer", balancer="balancer.law:LAW")))

    def run(weight: float) -> RunData:
        values = {"common": {"duration": 2.0, "tick": 0.01}, "controller": {"base_turn_weight": weight}}
        return simulate(load_scenario("smooth", {"law": "balancer", **values}))

    held, balanced = run(0.0), run(1e5)
    turns = [np.linalg.norm(base_rotation(each).values, axis=1).max() for each in (held, balanced)]
    assert turns[1] < turns[0] / 3.0
    for each in (held, balanced):
        apart = each.tool_pose["arm_a"][:, :3] - each.target_pose["arm_a"][:, :3]
        assert np.linalg.norm(apart, axis=1).max() < 2e-4  # m
        assert {plan.status for plan in each.plans} == {PlanStatus.SOLVED} and len(each.plans) == 101
        assert np.abs(each.angular_momentum).max() < 1e-9
    assert np.abs(held.joint_position[:, 7:] - held.joint_position[0, 7:]).max() < 1e-3  # rad
    assert PhaseState.FAILED not in {phase.state for phase in balanced.phases}


def test_after_a_phase_led_by_joints_a_preview_begins_where_they_end() -> None:
    """The tool that leads next is expected there, with the base where it is."""
    scenario = load_scenario("tumbling")
    robot, schedule = scenario.model.robot, scenario.model.schedule
    index = next(k for k, phase in enumerate(schedule.phases) if phase.name == "carry")
    phase, joints = schedule.phases[index], initial_joints(robot, schedule)
    preview, still = TargetPreview(robot, schedule), np.zeros(robot.n_joints)
    q, ends = start(scenario), np.array(joints)
    for arm, led in phase.targets.items():
        assert isinstance(led, JointTarget)
        ends[robot.arm_joints[arm]] = led.position
    reference, v = JointReference(0, joints, still), np.zeros(robot.pin.nv)
    preview.update(TaskPhase(0, index, phase.name), reference, robot.tools_at(q), q, v)
    (target,) = preview.ahead([phase.end_ns - phase.start_ns])
    expected_tool = robot.tools_at(np.concatenate([q[:BASE_NQ], ends]))["arm_b"]
    np.testing.assert_allclose(target.tool_in_world["arm_b"].position, expected_tool.position, atol=1e-9)
