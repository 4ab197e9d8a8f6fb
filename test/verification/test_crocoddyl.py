"""Optimal plans of the predictive law against Crocoddyl, which optimises the floating base by another method.

Crocoddyl has the robot with all its degrees of freedom, efforts as inputs and a sweep over time (FDDP). Ours
has the momentum eliminated, accelerations as inputs and one dense program. With no limit in the way both have
the same optimum, but for how the base is integrated over an interval. ``make crocoddyl`` makes
the environment: its wheels are wrong beside a Pinocchio that they were not built with.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.momentum import base_start
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.planner import Planner, PlanStart
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plan_report import PlanStatus
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import gains_by_phase, initial_joints
from sms_handover.types import Array, Pose, Twist

crocoddyl: Any = pytest.importorskip("crocoddyl", reason="make crocoddyl has it, beside its Pinocchio")

_TWIST = np.array([0.004, -0.003, 0.002, 0.01, -0.02, 0.015])  # m/s, rad/s
_ROUNDS = 30  # [-] of either solver; they converge in fewer


def running_costs(state: Any, robot: RobotModel, goals: dict[str, Pose], gains: MpcGains, rate: float) -> Any:
    """Return the cost of a state: tools off their goals, and joint rates with the weight ``rate``."""
    inputs = robot.n_joints
    costs = crocoddyl.CostModelSum(state, inputs)

    def add(name: str, residual: Any, weights: Array) -> None:
        activation = crocoddyl.ActivationModelWeightedQuad(weights)
        costs.addCost(name, crocoddyl.CostModelResidual(state, activation, residual), 1.0)

    for arm, goal in goals.items():
        frame, rotation = robot.tool_frame_id[arm], pin.Quaternion(goal.quaternion_xyzw).matrix()
        place = crocoddyl.ResidualModelFrameTranslation(state, frame, goal.position, inputs)
        turn = crocoddyl.ResidualModelFrameRotation(state, frame, rotation, inputs)
        add(f"{arm} position", place, np.full(3, gains.tool_position_weight))
        add(f"{arm} orientation", turn, np.full(3, gains.tool_orientation_weight))
    weights = np.zeros(state.ndx)
    weights[-robot.n_joints :] = rate
    add("rates", crocoddyl.ResidualModelState(state, state.zero(), inputs), weights)
    return costs


class HeldAcceleration(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
    """One interval under the acceleration at its beginning: q + v h + a h^2/2, v + a h; with a cost of a."""

    def __init__(self, dynamics: Any, h: float, weight: float, scale: float) -> None:
        crocoddyl.ActionModelAbstract.__init__(self, dynamics.state, dynamics.nu, 0)
        self.dynamics, self.h, self.weight, self.scale = dynamics, h, weight, scale
        self.inner = dynamics.createData()

    def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
        """Compute the next state and the cost."""
        nv, h = self.state.nv, self.h
        u = np.zeros(self.nu) if u is None else u
        self.dynamics.calc(self.inner, x, u)
        a = self.inner.xout
        self.step = np.concatenate([x[-nv:] * h + 0.5 * h * h * a, h * a])
        data.xnext = self.state.integrate(x, self.step)
        joints = a[BASE_NV:]
        data.cost = self.scale * (self.inner.cost + 0.5 * self.weight * float(joints @ joints))

    def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
        """Compute the derivatives."""
        nv, h, inner = self.state.nv, self.h, self.inner
        u = np.zeros(self.nu) if u is None else u
        self.dynamics.calcDiff(inner, x, u)
        fx, fu = np.array(inner.Fx), np.array(inner.Fu)
        by_x, by_u = np.vstack([0.5 * h * h * fx, h * fx]), np.vstack([0.5 * h * h * fu, h * fu])
        by_x[:nv, nv:] += h * np.eye(nv)
        first, second = self.state.Jintegrate(x, self.step, crocoddyl.Jcomponent.both)
        data.Fx, data.Fu = first + second @ by_x, second @ by_u
        a, ax, au = inner.xout[BASE_NV:], fx[BASE_NV:], fu[BASE_NV:]
        scale, weight = self.scale, self.weight
        data.Lx = scale * (inner.Lx + weight * ax.T @ a)
        data.Lu = scale * (inner.Lu + weight * au.T @ a)
        data.Lxx = scale * (inner.Lxx + weight * ax.T @ ax)
        data.Lxu = scale * (inner.Lxu + weight * ax.T @ au)
        data.Luu = scale * (inner.Luu + weight * au.T @ au)


def by_crocoddyl(
    robot: RobotModel, q: Array, v: Array, goals: dict[str, Pose], gains: MpcGains, horizon: Horizon
) -> Array:
    """Return the joint rates (N + 1, n) of the optimum."""
    state = crocoddyl.StateMultibody(robot.pin)
    actuation = crocoddyl.ActuationModelFloatingBase(state)

    def node(rate: float, h: float, weight: float, scale: float) -> Any:
        costs = running_costs(state, robot, goals, gains, rate)
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        return HeldAcceleration(dynamics, h, weight, scale)

    nodes = [
        node(gains.joint_rate_weight, h, gains.joint_acceleration_weight, h)
        for h in horizon.intervals.tolist()
    ]
    end = node(gains.terminal_rate_weight, 0.0, 0.0, 1.0)
    start = np.concatenate([q, v])
    problem = crocoddyl.ShootingProblem(start, nodes, end)
    solver = crocoddyl.SolverFDDP(problem)
    solver.th_stop = 1e-18
    still = [np.zeros(robot.n_joints)] * horizon.count
    solver.solve(problem.rollout(still), still, _ROUNDS, False)
    return np.array([x[-robot.n_joints :] for x in solver.xs])


def by_ours(planner: Planner, start: PlanStart, goals: dict[str, Pose], horizon: Horizon) -> Array:
    """Return the joint rates (N + 1, n) of the optimum, at which no limit binds."""
    n, still = len(start.q), Twist(np.zeros(3), np.zeros(3))
    target = PreviewedTargets(
        goals, dict.fromkeys(goals, still), start.q, np.zeros(n), "", next(iter(goals.values())), frozenset()
    )
    accelerations = np.zeros((horizon.count, n))
    for _ in range(_ROUNDS):
        solution = planner.step(start, accelerations, [target] * horizon.count).solution
        assert solution.status is PlanStatus.SOLVED and not solution.active
        accelerations = accelerations + solution.change.reshape(accelerations.shape)
        if np.abs(solution.change).max() < 1e-11:
            break
    return horizon.motion(start.q, start.w, accelerations)[1]


@pytest.mark.parametrize("moves", [False, True], ids=["at rest", "with momentum"])
def test_the_optimum_is_that_of_crocoddyl(moves: bool) -> None:
    """With the shipped horizon, and ever better with shorter intervals.

    Crocoddyl holds the acceleration of the base over an interval, ours keeps its momentum, so that the two
    differ in the first order of the interval; extrapolated, they do not.
    """
    scenario = load_scenario("paper", {"law": "mpc"})
    robot, schedule = scenario.model.robot, scenario.model.schedule
    gains = gains_by_phase(schedule, scenario.parameters.controller)[0]
    if moves:  # desired rates are then those against the momentum, which Crocoddyl has no word for
        gains = replace(gains, joint_rate_weight=0.0, terminal_rate_weight=0.0)
    q = robot.configuration(schedule.base_in_world, initial_joints(robot, schedule))
    v = np.concatenate([_TWIST if moves else np.zeros(BASE_NV), np.zeros(robot.n_joints)])
    offset = np.array([0.05, -0.03, 0.04])  # m
    goals = {
        arm: Pose(tool.position + offset, tool.quaternion_xyzw) for arm, tool in robot.tools_at(q).items()
    }
    start = PlanStart(q[BASE_NQ:], v[BASE_NV:], base_start(robot, q, v))

    def difference(length: float, count: int, first: float) -> float:
        asked = replace(gains, plan_horizon=length, plan_intervals=count, plan_first_interval=first)
        planner = Planner(robot, asked, None, np.eye(3))
        ours = by_ours(planner, start, goals, planner.horizon)
        other = by_crocoddyl(robot, q, v, goals, asked, planner.horizon)
        assert np.abs(ours).max() > 0.05
        return float(np.abs(ours - other).max() / np.abs(ours).max())

    shipped = difference(gains.plan_horizon, gains.plan_intervals, gains.plan_first_interval)
    coarse, middle, fine = (difference(0.8, count, 0.8 / count) for count in (4, 8, 16))
    assert shipped < 1e-2
    assert fine < 0.6 * middle < 0.6 * coarse
    assert abs(2.0 * fine - middle) < 5e-4
