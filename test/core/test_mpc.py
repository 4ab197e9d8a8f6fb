"""The predictive law: what it predicts, its derivatives, its program, the limits it keeps."""

import json
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.mpc import quadratic_program
from sms_handover.control.mpc.constraints import Constraint
from sms_handover.control.mpc.controller import MpcController, MpcState
from sms_handover.control.mpc.distance_rows import DistanceModel
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.momentum import BaseStart, base_start
from sms_handover.control.mpc.patience import Patience
from sms_handover.control.mpc.placement import placements
from sms_handover.control.mpc.plan import Plan
from sms_handover.control.mpc.plan_queue import PlanQueue
from sms_handover.control.mpc.planner import Planner, PlanStart
from sms_handover.control.mpc.prediction import Prediction, PredictionModel
from sms_handover.control.mpc.quadratic_program import Solution, solve
from sms_handover.control.mpc.sensitivity import Sensitivity
from sms_handover.control.mpc.tool_errors import ToolErrorModel
from sms_handover.errors import ConfigurationError, ControllerError, MissingDependencyError, NoPlanError
from sms_handover.graph.events import PLAN_FAILED
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.reduced import reduced_inverse_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plan_report import PlannedPaths, PlanReport, PlanStatus
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.run_data import RunData
from sms_handover.scene.planned_lines import planned_lines
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import Snapshot, plain, structured
from sms_handover.simulation.wiring import gains_by_phase, initial_joints, make_clearance
from sms_handover.trajectory.preview import TargetPreview
from sms_handover.types import (
    Array,
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    JointReference,
    Pose,
    TaskPhase,
    Twist,
)

from .conftest import Draw

HORIZON = Horizon.growing(1.6, 10, 0.05)
STEP = 1e-6  # [rad/s^2] of central differences; their error is about 1e-9 here


def scenario_of(name: str, seconds: float, **controller: object) -> Scenario:
    """Return the beginning of a shipped scenario under the predictive law, without distances if not given.

    They are most of what a solve takes, and have tests of their own.
    """
    gains = {"law": "mpc", "least_distance": 0.0, **controller}
    return load_scenario(name, {"common": {"duration": seconds}, "controller": gains})


def controller_of(loop: Loop) -> MpcController:
    """Return the predictive controller of a loop."""
    assert isinstance(loop.controller, MpcController)
    return loop.controller


@pytest.fixture
def moving(robot: RobotModel, draw: Draw) -> tuple[BaseStart, Array, Array, Array, Array]:
    """A start with momentum, joint angles and rates, accelerations, and the configuration it belongs to."""
    q, v = draw.q(), draw.v(0.3)
    return base_start(robot, q, v), q[BASE_NQ:], v[BASE_NV:], draw.random.uniform(-0.3, 0.3, (10, 14)), q


def test_intervals_grow_and_fill_the_horizon() -> None:
    ratios = HORIZON.intervals[1:] / HORIZON.intervals[:-1]
    assert HORIZON.intervals[0] == pytest.approx(0.05, abs=1e-12)
    assert HORIZON.times[-1] == pytest.approx(1.6, abs=1e-12)
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-12)
    with pytest.raises(ConfigurationError, match=r"must be <= plan_horizon / plan_intervals = 0.04 s"):
        Horizon.growing(0.4, 10, 0.05)


def test_a_plan_lasts_until_the_next_one() -> None:
    short = {"plan_horizon": 0.05, "plan_intervals": 2, "law": "mpc"}
    scenario = load_scenario("paper", {"common": {"reference_period": 0.1}, "controller": short})
    with pytest.raises(
        ConfigurationError,
        match=r"plan_horizon is 0.05 s, must be >= 0.6 s, one reference period and failed_plans more",
    ):
        Loop(scenario)


def test_momentum_stays_what_it_was(
    robot: RobotModel, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    """The predicted configuration and velocity have the momenta and the centre of mass of a free robot."""
    start, joints, rates, accelerations, _ = moving
    predicted = PredictionModel(robot).predict(HORIZON, start, joints, rates, accelerations)
    velocity = [np.concatenate(pair) for pair in zip(predicted.twist, predicted.w, strict=True)]
    for time, place, v in zip(HORIZON.times, placements(predicted), velocity, strict=True):
        found = conserved_quantities(robot, place.q, v)
        drift = time / robot.mass * start.linear_momentum
        np.testing.assert_allclose(found.linear_momentum, start.linear_momentum, atol=1e-12)
        np.testing.assert_allclose(found.angular_momentum, start.angular_momentum, atol=1e-12)
        np.testing.assert_allclose(found.centre_of_mass, start.centre_of_mass + drift, atol=1e-12)


def test_efforts_are_those_of_the_inverse_dynamics(
    robot: RobotModel, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    start, joints, rates, accelerations, _ = moving
    predicted = PredictionModel(robot).predict(HORIZON, start, joints, rates, accelerations)
    for k in range(HORIZON.count):
        q = np.concatenate([np.zeros(6), [1.0], predicted.q[k]])
        v = np.concatenate([predicted.twist[k], predicted.w[k]])
        expected = reduced_inverse_dynamics(robot, q, v, accelerations[k])
        np.testing.assert_allclose(predicted.effort[k], expected, rtol=0.0, atol=1e-11)


def test_the_attitude_is_that_of_small_steps(
    robot: RobotModel, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    """A hundred intervals of a hundredth of the length agree with ten to the second order of the step."""
    start, joints, rates, accelerations, _ = moving
    model, coarse = PredictionModel(robot), Horizon(np.full(10, 0.02))
    fine = Horizon(np.full(100, 0.002))
    one = model.predict(coarse, start, joints, rates, accelerations).rotation[-1]
    other = model.predict(fine, start, joints, rates, np.repeat(accelerations, 10, axis=0)).rotation[-1]
    assert np.linalg.norm(pin.log3(one.T @ other)) < 2e-5


def outputs(
    prediction: Prediction, tools: ToolErrorModel, apart: DistanceModel, targets: list[PreviewedTargets]
) -> dict[str, Array]:
    """Return every output of a prediction that a plan has rows for."""
    placed = placements(prediction)
    return {
        "effort": prediction.effort,
        "omega": prediction.omega,
        "phi": prediction.phi,
        "tools": tools.at(placed[1:], targets).errors,
        "distances": apart.at(placed, targets).distance,
    }


def test_rows_are_the_derivatives_of_the_outputs(
    robot: RobotModel, draw: Draw, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    """By central differences along random changes of all accelerations, with momentum, and a held deputy."""
    start, joints, rates, accelerations, q = moving
    schedule = load_scenario("smooth").model.schedule
    distances = NearPairs(make_clearance(robot, schedule))
    tools, apart = ToolErrorModel(robot), DistanceModel(robot, distances, 2, 0.02)
    model, still = PredictionModel(robot), Twist(np.zeros(3), np.zeros(3))
    here = robot.tools_at(q)
    goals = {arm: draw.near(here[arm], 0.2) for arm in robot.arms}
    grasp = schedule.deputy.grasp_frames["end_a"]
    target = PreviewedTargets(
        goals, dict.fromkeys(goals, still), joints, rates, "arm_a", grasp, frozenset({"arm_a"})
    )
    targets = [target] * HORIZON.count

    def at(change: Array) -> Prediction:
        return model.predict(HORIZON, start, joints, rates, accelerations + change)

    about = at(np.zeros_like(accelerations))
    sensitivity, placed, later = Sensitivity(HORIZON, about), placements(about), slice(1, 11)
    rows = {
        "effort": sensitivity.rows(about.effort_by, slice(0, 10)),
        "omega": sensitivity.rows(about.omega_by, slice(0, 11)),
        "phi": sensitivity.phi,
        "tools": sensitivity.rows(tools.at(placed[1:], targets).by, later),
        "distances": sensitivity.rows(apart.at(placed, targets).by, later),
    }
    bounds = {"effort": 1e-8, "omega": 1e-8, "phi": 1e-7, "tools": 1e-7, "distances": 2e-4}
    for _ in range(3):
        change = draw.random.normal(size=accelerations.shape)
        forward = outputs(at(STEP * change), tools, apart, targets)
        backward = outputs(at(-STEP * change), tools, apart, targets)
        for name, by in rows.items():
            numeric = (forward[name] - backward[name]) / (2.0 * STEP)
            np.testing.assert_allclose(
                by @ change.ravel(), numeric, rtol=0.0, atol=bounds[name], err_msg=name
            )


def planner_of(robot: RobotModel, **values: object) -> Planner:
    """Return a planner with the shipped parameters but for some."""
    scenario = scenario_of("smooth", 1.0, **values)
    gains = gains_by_phase(scenario.model.schedule, scenario.parameters.controller)[0]
    return Planner(robot, gains, None, np.eye(3))


def cost_of(
    robot: RobotModel, planner: Planner, predicted: Prediction, a: Array, targets: list[PreviewedTargets]
) -> float:
    """Return the cost of a prediction, written out instant by instant."""
    gains, horizon = planner.gains, planner.horizon
    errors = ToolErrorModel(robot).at(placements(predicted)[1:], targets).errors
    weights = np.tile([gains.tool_position_weight] * 3 + [gains.tool_orientation_weight] * 3, 2)
    total = 0.0
    for k, target in enumerate(targets, start=1):
        last = k == horizon.count
        time = 1.0 if last else horizon.intervals[k]
        total += 0.5 * time * float(weights @ errors[k - 1] ** 2)
        rate = gains.terminal_rate_weight if last else time * gains.joint_rate_weight
        total += 0.5 * rate * float(np.sum((predicted.w[k] - target.joint_velocity) ** 2))
        if not target.tool_in_world:
            off = predicted.q[k] - target.joint_position
            total += 0.5 * time * gains.joint_position_weight * float(off @ off)
        still = horizon.intervals[k - 1]
        total += 0.5 * gains.joint_acceleration_weight * still * float(a[k - 1] @ a[k - 1])
    return total


@pytest.mark.parametrize("led", ["tools", "joints"])
def test_the_gradient_is_that_of_the_cost(
    led: str, robot: RobotModel, draw: Draw, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    """By central differences, with momentum; of joints that tools lead the rates have no weight here."""
    start, joints, rates, accelerations, q = moving
    weights = {"joint_rate_weight": 0.0, "terminal_rate_weight": 0.0} if led == "tools" else {}
    planner, still = planner_of(robot, **weights), Twist(np.zeros(3), np.zeros(3))
    goals = {arm: draw.near(pose, 0.2) for arm, pose in robot.tools_at(q).items()} if led == "tools" else {}
    aims = joints + draw.vector(14, 0.1), draw.vector(14, 0.1)
    deputy = load_scenario("smooth").model.schedule.deputy.deputy_in_world
    target = PreviewedTargets(goals, dict.fromkeys(goals, still), *aims, "", deputy, frozenset())
    targets = [target] * 10

    def cost(a: Array) -> float:
        predicted = planner.prediction.predict(planner.horizon, start, joints, rates, a)
        return cost_of(robot, planner, predicted, a, targets)

    gradient = planner.program(PlanStart(joints, rates, start), accelerations, targets).gradient
    for _ in range(3):
        change = draw.random.normal(size=accelerations.shape)
        numeric = (cost(accelerations + 1e-5 * change) - cost(accelerations - 1e-5 * change)) / 2e-5
        assert gradient @ change.ravel() == pytest.approx(numeric, rel=1e-6, abs=1e-7)


def test_a_target_that_the_momentum_follows_needs_nothing(
    robot: RobotModel, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    """Targets that move as the tools do with the joints at rest: there the cost has its minimum."""
    start, joints, _, _, _ = moving
    planner, rest, nothing = planner_of(robot), np.zeros(14), np.zeros((10, 14))
    predicted = planner.prediction.predict(planner.horizon, start, joints, rest, nothing)
    targets = []
    for place, twist in zip(placements(predicted)[1:], predicted.twist[1:], strict=True):
        pin.forwardKinematics(robot.pin, robot.data, place.q, np.concatenate([twist, rest]))
        tools = robot.tools_at(place.q)
        rates = {}
        for arm, frame in robot.tool_frame_id.items():
            moved = pin.getFrameVelocity(robot.pin, robot.data, frame, pin.LOCAL_WORLD_ALIGNED)
            rates[arm] = Twist(np.array(moved.linear), np.array(moved.angular))
        held = PreviewedTargets(tools, rates, joints, rest, "", tools["arm_a"], frozenset())
        targets.append(held)
    assert max(np.linalg.norm(rate.linear) for rate in targets[0].tool_twist_in_world.values()) > 0.01
    gradient = planner.program(PlanStart(joints, rest, start), nothing, targets).gradient
    np.testing.assert_allclose(gradient, 0.0, atol=1e-5)


def test_iterations_converge_to_where_the_optimality_conditions_hold(robot: RobotModel) -> None:
    """Changes and residuals vanish at an optimum at which limits of efforts and rates bind."""
    scenario = scenario_of("paper", 1.0)
    schedule = scenario.model.schedule
    q = robot.configuration(schedule.base_in_world, initial_joints(robot, schedule))
    planner = planner_of(robot, joint_rate_limit=0.1, effort_share=0.02)
    off = np.array([0.1, 0.0, 0.1])  # m
    tools = robot.tools_at(q)
    goals = {arm: Pose(tool.position + off, tool.quaternion_xyzw) for arm, tool in tools.items()}
    rest, still = np.zeros(14), Twist(np.zeros(3), np.zeros(3))
    target = PreviewedTargets(
        goals, dict.fromkeys(goals, still), q[BASE_NQ:], rest, "", goals["arm_a"], frozenset()
    )
    start, a = PlanStart(q[BASE_NQ:], rest, base_start(robot, q, np.zeros(20))), np.zeros((10, 14))
    changes, step = list[float](), None
    for _ in range(10):
        step = planner.step(start, a, [target] * 10).solution
        assert step.status is PlanStatus.SOLVED and step.kkt_residual < 1e-9
        a = a + step.change.reshape(a.shape)
        changes.append(float(np.abs(step.change).max()))
    assert step is not None and any("rate" in row for row in step.active)
    assert any("effort" in row for row in step.active)
    assert changes[-1] < 1e-7 < changes[0]


def constraint(matrix: Array, low: Array, high: Array, *, soft: bool) -> Constraint:
    """Return rows about zero with a name each."""
    names = tuple(f"{'soft' if soft else 'hard'} {row}" for row in range(len(matrix)))
    return Constraint(names, np.zeros(len(matrix)), matrix, low, high, low, high, np.ones(len(matrix)), soft)


def test_the_program_meets_its_optimality_conditions(draw: Draw) -> None:
    """Hard rows hold, soft ones are exceeded by little, the gradient is a sum of binding rows."""
    root = draw.random.normal(size=(20, 20))
    hessian, gradient = root @ root.T + np.eye(20), draw.vector(20, 30.0)
    free = np.linalg.solve(hessian, -gradient)
    hard = constraint(np.eye(20), np.full(20, -0.3), np.full(20, 0.3), soft=False)
    found = solve(hessian, gradient, [hard], 300)
    assert found.status is PlanStatus.SOLVED and found.active and found.kkt_residual < 1e-10
    assert np.abs(found.change).max() <= 0.3 + 1e-9 < np.abs(free).max()
    bound = np.abs(np.abs(found.change) - 0.3) < 1e-9
    assert found.active == tuple(f"hard {row}" for row in np.flatnonzero(bound))
    slope = hessian @ found.change + gradient
    assert np.abs(slope[~bound]).max() < 1e-8 and (slope[bound] * found.change[bound] <= 0.0).all()
    wide = constraint(np.eye(20), np.full(20, -9e9), np.full(20, 9e9), soft=False)
    np.testing.assert_allclose(solve(hessian, gradient, [wide], 300).change, free, atol=1e-9)


def test_rows_that_contradict_each_other_are_named(draw: Draw) -> None:
    """A soft one is exceeded and reported; between hard ones there is no plan, and the worst is named."""
    one = np.ones((1, 3))
    upper = constraint(one, np.array([-9e9]), np.array([-1.0]), soft=False)
    lower = constraint(one, np.array([2.0]), np.array([9e9]), soft=True)
    soft = solve(np.eye(3), np.zeros(3), [upper, lower], 300)
    assert soft.status is PlanStatus.SOLVED
    assert soft.largest_slack_row == "soft 0" and abs(soft.largest_slack - 3.0) < 1e-6
    hard = solve(
        np.eye(3), np.zeros(3), [upper, constraint(one, *map(np.array, ([2.0], [9e9])), soft=False)], 300
    )
    assert hard.status is PlanStatus.INFEASIBLE and hard.largest_slack_row == "hard 0"
    assert hard.change.size == 0
    endless = solve(np.eye(3), np.zeros(3), [upper, lower], 1)
    assert endless.status is PlanStatus.ITERATION_LIMIT
    assert endless.largest_slack_row == "soft 0" and endless.largest_slack == pytest.approx(2.0)
    for wrong in (-np.eye(3), np.full((3, 3), np.nan)):
        with pytest.raises(ControllerError, match="expected a convex and finite program"):
            solve(wrong, np.zeros(3), [upper], 300)


def test_patience_names_the_limit_that_keeps_the_arms_from_their_task() -> None:
    """Unless plans have lasted for a horizon in between, and once the plan that brakes is over."""
    row, nothing = "distance arm_a_gripper - arm_b_gripper", np.zeros(0)
    stuck = Solution(PlanStatus.ITERATION_LIMIT, nothing, 300, (), 0.05, row, float("nan"))
    patience, queue = Patience(20_000_000), PlanQueue()
    queue.offer(Plan(1, 0, np.zeros(1), np.zeros(1), np.zeros((2, 1)), np.full(2, 0.1)))
    for _ in range(2):
        patience.brakes(stuck)
    for _ in range(80):
        patience.solved(1.6)
    for count in range(3):
        assert not patience.is_over, count
        patience.brakes(stuck)
    assert patience.is_over
    assert not patience.is_at_rest(700_000_000, queue) and patience.is_at_rest(701_000_000, queue)
    told = str(patience.error(720_000_000, 0.0, ""))
    assert f"at 0.72 s: {row} exceeds its limit by 0.05 m, relax it" in told
    told = str(patience.error(720_000_000, 0.1, "base rate about z"))
    assert "at 0.72 s: base rate about z exceeds its limit by 0.1 rad/s" in told


def test_without_its_solver_the_law_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> object:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(quadratic_program, "import_module", missing)
    with pytest.raises(MissingDependencyError, match=r"pip install 'sms_handover\[mpc\]'"):
        Loop(scenario_of("paper", 1.0))


LIMITS = {
    "joint_rate_limit": 0.2,  # rad/s
    "base_rate_limit": 0.0052,  # rad/s
    "base_attitude_limit": 0.006,  # rad
}


def peaks(run: RunData) -> dict[str, float]:
    """Return what the limits are for."""
    turned = [pin.log3(pin.Quaternion(row[3:]).matrix()) for row in run.base_pose[::20]]
    return {
        "joint_rate_limit": float(np.abs(run.joint_velocity).max()),
        "base_rate_limit": float(np.abs(run.base_twist[:, 3:]).max()),
        "base_attitude_limit": float(np.abs(turned).max()),
    }


@pytest.fixture(scope="module")
def free() -> RunData:
    """The beginning of the paper's task without limits but those of the robot."""
    return simulate(scenario_of("paper", 1.6))


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_kept_that_binds(name: str, free: RunData) -> None:
    """Within 1 % over the step of the paper's task; without it, it would be exceeded."""
    run = simulate(scenario_of("paper", 1.6, **{name: LIMITS[name]}))
    assert peaks(run)[name] <= 1.01 * LIMITS[name] < 0.9 * peaks(free)[name]
    word = name.removesuffix("_limit").replace("joint_", "").replace("_", " ")
    assert any(word in row for plan in run.plans for row in plan.active)
    slack = max(run.plans, key=lambda plan: plan.largest_slack)
    assert 0.0 < slack.largest_slack < 0.02 * LIMITS[name] and word in slack.largest_slack_row
    assert all(plan.largest_slack == 0.0 for plan in free.plans)


def test_the_limits_of_the_tight_scenario_are_kept_and_needed() -> None:
    """Up to beyond the middle of the first motion; the closed form exceeds that of the joints there."""
    values = {"common.duration": 8.6, "common.tick": 0.02}
    planned = simulate(load_scenario("tight", values))
    free = simulate(load_scenario("tight", {**values, "law": "nmpc"}))
    limits = load_scenario("tight").parameters.controller
    kept, exceeded = peaks(planned), peaks(free)
    assert kept["base_rate_limit"] <= 1.01 * limits.base_rate_limit
    assert kept["joint_rate_limit"] <= 1.01 * limits.joint_rate_limit < 0.9 * exceeded["joint_rate_limit"]


def test_as_shipped_no_body_is_led_through_another() -> None:
    """The paper's steps, one soon after the other: the shortest way of a gripper is through the deputy."""
    values: dict[str, object] = {"law": "mpc", "common.tick": 0.02, "common.duration": 2.9}
    for name in ("approach", "carry"):
        values |= {f"schedule.phases.{name}.duration": 2.0, f"schedule.phases.{name}.motion": 1.5}
    kept = Loop(load_scenario("paper", values))
    without = Loop(load_scenario("paper", {**values, "controller.least_distance": 0.0}))
    near = NearPairs(make_clearance(kept.scenario.model.robot, kept.scenario.model.schedule))
    (pair,) = [row for row, item in enumerate(near.pairs) if item.names == ("arm_b_gripper", "deputy")]
    while kept.state.stamp_ns < 2_000_000_000:
        kept.advance_period()
    without.restore(kept.snapshot())

    def nearest(loop: Loop) -> float:
        found = np.inf
        while not loop.finished:
            q, period = loop.state.q, loop.advance_period().period
            assert period is not None
            found = min(found, float(near.distances(q, period.deputy.deputy_in_world)[pair]))
        return found

    assert nearest(without) < -0.03  # m
    assert nearest(kept) > 0.0007  # m, of 1 mm where it may touch


def test_a_robot_without_bodies_needs_no_distances(
    robot: RobotModel, moving: tuple[BaseStart, Array, Array, Array, Array]
) -> None:
    class Nothing:
        pairs = ()

    start, joints, rates, accelerations, _ = moving
    gains = replace(planner_of(robot).gains, least_distance=0.01)
    aim = PreviewedTargets({}, {}, joints, rates, "", pose_of(pin.SE3.Identity()), frozenset())
    problem = PlanStart(joints, rates, start), accelerations, [aim] * 10
    step = Planner(robot, gains, Nothing(), np.eye(3)).step(*problem)  # type: ignore[arg-type]
    assert step.solution.change.tobytes() == planner_of(robot).step(*problem).solution.change.tobytes()


def test_a_plan_begins_where_the_robot_will_be() -> None:
    """One period of delay, predicted: joints, rates and attitude are met when the plan comes into use."""
    loop = Loop(scenario_of("paper", 1.0))
    controller = controller_of(loop)
    for _ in range(25):
        loop.advance_period()
    state, coming = loop.state, controller.state.coming
    assert coming is not None and coming.begin_ns == state.stamp_ns
    assert np.abs(state.joint_velocity).max() > 0.1
    np.testing.assert_allclose(coming.q, state.joint_position, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(coming.w, state.joint_velocity, rtol=0.0, atol=1e-3)


def test_planned_paths_are_those_that_the_tools_then_take() -> None:
    """Of every fifth plan: it begins where the tools are one period later, and they go on along it."""
    run, arm = simulate(scenario_of("smooth", 1.2)), "arm_a"
    assert [paths.stamp_ns for paths in run.planned_paths] == run.reference_ns[::5].tolist()
    paths = run.planned_paths[8]
    horizon = Horizon.growing(1.6, 10, 0.02)  # as shipped
    stamps, taken = paths.stamp_ns + 20_000_000 + 1e9 * horizon.times[:4], run.tool_pose[arm][:, :3].T
    then = np.array([np.interp(stamps, run.reference_ns, row) for row in taken]).T
    np.testing.assert_allclose(paths.tool_in_world[arm][0], then[0], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(paths.tool_in_world[arm][:4], then, rtol=0.0, atol=1e-5)
    assert np.linalg.norm(then[3] - then[0]) > 5e-4
    lines = planned_lines(run.planned_paths, ("arm_b", arm))
    assert lines is not None and lines.points.shape == (len(run.planned_paths), 2, 11, 3)
    assert lines.points[3, 1].tobytes() == run.planned_paths[3].tool_in_world[arm].tobytes()
    shorter = PlannedPaths(0, {arm: np.eye(3)[:2]})
    padded = planned_lines([shorter, *run.planned_paths[:1]], (arm, "arm_c"))
    assert padded is not None and np.isnan(padded.points[:, 1]).all()
    assert (padded.points[0, 0, 1:] == np.eye(3)[1]).all()


def test_targets_are_those_of_the_instants_of_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan begins a period after the state; its first target is that after its first interval."""
    loop, asked = Loop(scenario_of("smooth", 1.0)), list[int]()
    ahead = TargetPreview.ahead

    def spied(preview: TargetPreview, stamps_ns: Iterable[int]) -> tuple[PreviewedTargets, ...]:
        asked.extend(stamps_ns)
        return ahead(preview, asked)

    monkeypatch.setattr(TargetPreview, "ahead", spied)
    loop.advance_period()
    coming = controller_of(loop).state.coming
    assert coming is not None and coming.begin_ns == 20_000_000
    np.testing.assert_allclose(asked, 20_000_000 + 1e9 * coming.horizon.times[1:], rtol=0.0, atol=1.0)


def test_a_plan_is_followed_from_node_to_node(draw: Draw) -> None:
    """It is the double integrator in closed form, and stands after its end; its means give its rates back."""
    q, w, a = draw.joints(), draw.vector(14), draw.random.normal(size=(10, 14))
    plan = Plan(1, 0, q, w, a, HORIZON.intervals)
    for interval, start, mean in zip(HORIZON.intervals, HORIZON.times[:-1], a, strict=True):
        now = plan.after(float(start))
        then = now[0] + interval * now[1] + 0.5 * interval**2 * mean
        np.testing.assert_allclose(plan.after(float(start + interval - 1e-12))[0], then, atol=1e-9)
    assert not plan.after(plan.end_s + 1.0)[1:].any()
    shifted = plan.resampled(HORIZON, 30_000_000)
    rates = plan.after(0.03)[1] + np.cumsum(HORIZON.intervals[:, None] * shifted, axis=0)
    expected = [plan.after(0.03 + float(time))[1] for time in HORIZON.times[1:]]
    np.testing.assert_allclose(rates, expected, atol=1e-12)


def test_solves_that_fail_are_carried_by_the_plan_before_then_the_arms_brake() -> None:
    """At the limit of iterations the old plan is used and counted; after five in a row the arms brake.

    Once they are at rest and there still is no plan the run ends and says why.
    """
    loop = Loop(scenario_of("paper", 4.0))
    for _ in range(30):
        loop.advance_period()
    before = loop.snapshot()
    failing = Loop(scenario_of("paper", 4.0, program_iterations=1, joint_rate_limit=0.05, failed_plans=5))
    failing.restore(before)
    failing.advance_period()
    snapshot = failing.snapshot()
    failing.restore(before)
    reports, rates, events = list[PlanReport](), list[float](), list[str]()

    def go_on() -> None:
        while not failing.finished:
            ticks = failing.advance_period()
            reports.extend([ticks.plan] if ticks.plan else [])
            rates.append(float(np.abs(ticks.rows.v[-1, BASE_NV:]).max()))
            events.extend(event.kind for told in ticks.excesses.values() for event in told)

    with pytest.raises(NoPlanError, match=r"at rest at .* s: its programs end after 1 iterations"):
        go_on()
    assert len(reports) == 15  # three times five solves
    statuses = [report.status for report in reports]
    assert statuses[:4] == [PlanStatus.ITERATION_LIMIT] * 4 and statuses[4] is PlanStatus.BRAKING
    assert [report.reused_plans for report in reports[:5]] == [1, 2, 3, 4, 5]
    assert [report.plan_age for report in reports[:3]] == pytest.approx([0.0, 0.02, 0.04])
    assert rates[0] > 0.1 and rates[-1] < 1e-3
    assert events.count(PLAN_FAILED) == 2  # the old plan is carried on, then the arms brake
    failing.restore(structured(Snapshot, plain(snapshot)))
    assert not any(failing.advance_period().excesses.values())  # that has been told before the snapshot


def test_the_state_has_every_bit_of_the_rest() -> None:
    """Through JSON and back, in the middle of a motion, between two plans."""
    loop = Loop(scenario_of("smooth", 1.0))
    for _ in range(15):
        loop.advance_period()
    loop.advance()
    snapshot = loop.snapshot()
    controller = structured(MpcState, json.loads(json.dumps(snapshot.controller)))
    other = Loop(scenario_of("smooth", 1.0))
    other.restore(replace(snapshot, controller=plain(controller)))
    for _ in range(3):
        one, two = loop.advance_period(), other.advance_period()
        for column in ("q", "v", "effort"):
            assert getattr(one.rows, column).tobytes() == getattr(two.rows, column).tobytes()


@pytest.mark.parametrize("law", ["quintic", "step"])
def test_the_preview_is_what_the_generator_will_say(law: str) -> None:
    """A second ahead, within phases and into those that begin without commands; held and free deputy."""
    duration = {"quintic": 48.0, "step": 12.0}[law]
    values = {"trajectory.time_law": law, "common.dynamics": "compiled", "common.duration": duration}
    scenario = load_scenario("smooth", values)
    robot, schedule = scenario.model.robot, scenario.model.schedule
    loop, preview, expected = Loop(scenario), TargetPreview(robot, schedule), dict[int, PreviewedTargets]()
    compared = 0
    while not loop.finished:
        state, period = loop.state, loop.advance_period().period
        assert period is not None
        now_ns, targets = period.phase.stamp_ns, period.targets_in_world
        for _ in range(2):  # told twice of one instant it expects the same
            preview.update(period.phase, period.reference, targets, state.q, state.v)
        for event in period.events:
            preview.grasped(event)
        if now_ns % 500_000_000 == 0:
            expected[now_ns + 1_000_000_000] = preview.ahead([now_ns, now_ns + 1_000_000_000])[1]
        told = expected.get(now_ns)
        before = schedule.phases[schedule.phase_index(max(now_ns - 1_000_000_000, 0))]
        phase = schedule.phases[schedule.phase_index(now_ns)]
        if told is None or (phase is not before and phase.commands):
            continue
        for arm in robot.arms:
            if arm in told.tool_in_world:
                off = np.linalg.norm(told.tool_in_world[arm].position - targets[arm].position)
                assert off < 4e-3, (now_ns, arm)  # what the base and the other arm move by
                compared += 1
            else:
                part = robot.arm_joints[arm]
                off = np.abs(told.joint_position[part] - period.reference.position[part]).max()
                assert off < 2e-3, (now_ns, arm)
    assert compared > duration


def test_targets_on_a_held_deputy_turn_with_the_robot(draw: Draw) -> None:
    """The whole turns and drifts as one body, with the joints at rest: a second ahead to rounding."""
    scenario = load_scenario("tumbling")
    robot, schedule = scenario.model.robot, scenario.model.schedule
    preview, q, v = TargetPreview(robot, schedule), draw.q(), np.zeros(20)
    names = [phase.name for phase in schedule.phases]
    index, frames = names.index("meet"), schedule.deputy.grasp_frames
    now_ns = schedule.phases[index].end_ns - 1_500_000_000  # the motion is over
    v[:BASE_NV] = [0.01, -0.02, 0.005, 0.03, 0.05, -0.04]  # m/s, rad/s
    reference = JointReference(now_ns, q[BASE_NQ:], np.zeros(14))

    def goal_at(q: Array) -> pin.SE3:
        deputy = se3_of(robot.tools_at(q)["arm_a"]) * se3_of(frames["end_a"]).inverse()
        return deputy * se3_of(frames["end_b"])

    def update(stamp_ns: int, phase: int) -> None:
        given = {"arm_b": pose_of(goal_at(q))} if phase == index else robot.tools_at(q)
        preview.update(TaskPhase(stamp_ns, phase, names[phase]), reference, given, q, v)

    update(0, 0)
    command = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
    preview.grasped(GraspEvent(0, command, GraspStatus.SUCCEEDED, 0.0, 0.0, 0.0, ""))
    update(schedule.phases[index].start_ns, index)
    update(now_ns, index)
    later = np.array(q)
    base = robot.integrate_base(Pose(q[:3], q[3:BASE_NQ]), v[:BASE_NV], 1.0)
    later[:BASE_NQ] = np.concatenate([base.position, base.quaternion_xyzw])
    before, then, after = preview.ahead([now_ns + stamp * 1_000_000 for stamp in (999, 1000, 1001)])
    goal, expected = se3_of(then.tool_in_world["arm_b"]), goal_at(later)
    np.testing.assert_allclose(pin.log6(goal.inverse() * expected).vector, 0.0, atol=1e-9)
    first, last = (se3_of(item.tool_in_world["arm_b"]) for item in (before, after))
    twist = then.tool_twist_in_world["arm_b"]
    np.testing.assert_allclose(twist.linear, (last.translation - first.translation) / 0.002, atol=1e-7)
    turned = pin.log3(last.rotation @ first.rotation.T) / 0.002
    np.testing.assert_allclose(twist.angular, turned, atol=1e-7)
