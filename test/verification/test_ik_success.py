"""Inverse kinematics: reachable targets, from afar and from near.

Every target is the pose of a tool at random joint angles within their limits, so it can be met.
All solvers get the same targets, the same seeds, the same tolerances and the same iterations.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import Array, IkRequest, IkStatus, Pose
from test.evidence import Record, Table
from test.verification.ik_library import Attempt, FixedBase

_TARGETS = 1000  # per arm
_TRIES = 10  # from afar: a seed that leads into a limit says nothing about the target
_NEAR = 0.05  # [rad] distance of a near seed in every joint
_MATLAB_BIAS = 2.5e-3  # [-] default damping bias of MATLAB's Levenberg-Marquardt solver
_BASE = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
_OURS, _MATLAB, _MINK = "ours", "ours with MATLAB's damping bias 2.5e-3", "mink, iterated"
_EPS = float(np.finfo(float).eps)

Solver = Callable[["Target", Array], Attempt]


@dataclass(frozen=True, eq=False)
class Target:
    """A pose for the tool of one arm, seeds from afar and one from near."""

    arm: str
    pose: Pose
    far: list[Array]
    near: Array


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a solver made of a target: the try that met it or the last one, and how many tries it took."""

    target: Target
    attempt: Attempt
    tries: int
    position_error: float
    angle_error: float
    beyond_limits: float


Outcomes = dict[tuple[str, str], list[Outcome]]  # by solver, and by "far" or "near"


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture(scope="module")
def parameters() -> IkParameters:
    """The parameters as shipped."""
    return load_parameters().ik


def _targets(robot: RobotModel) -> Iterator[Target]:
    """Draw the targets of all arms."""
    random = np.random.default_rng(3)
    for arm in robot.arms:
        for _ in range(_TARGETS):
            joints = random.uniform(robot.lower, robot.upper)
            near = np.clip(joints + random.uniform(-_NEAR, _NEAR, joints.size), robot.lower, robot.upper)
            far = [random.uniform(robot.lower, robot.upper) for _ in range(_TRIES)]
            yield Target(arm, robot.tools_in_world(_BASE, joints)[arm], far, near)


def _ours(robot: RobotModel, parameters: IkParameters) -> Solver:
    """Return our solver."""

    def solve(target: Target, seed: Array) -> Attempt:
        result = solve_ik(robot, IkRequest(_BASE, seed, {target.arm: target.pose}), parameters)
        return Attempt(result.joint_position, result.status is IkStatus.CONVERGED, result.iterations)

    return solve


def _mink(judge: FixedBase, parameters: IkParameters) -> Solver:
    """Return the other library's."""
    tolerance = min(parameters.position_tolerance, parameters.orientation_tolerance)

    def solve(target: Target, seed: Array) -> Attempt:
        return judge.solve(target.arm, target.pose, seed, tolerance, parameters.max_iterations)

    return solve


def _try_seeds(
    robot: RobotModel, judge: FixedBase, solve: Solver, target: Target, seeds: list[Array]
) -> Outcome:
    """Try one seed after another until the target is met, and judge the end by MuJoCo's kinematics."""
    tries, attempt = 1, solve(target, seeds[0])
    while not attempt.converged and tries < len(seeds):
        attempt = solve(target, seeds[tries])
        tries += 1
    errors = judge.errors(target.arm, attempt.joints, target.pose)
    beyond = np.max(np.maximum(robot.lower - attempt.joints, attempt.joints - robot.upper))
    return Outcome(target, attempt, tries, *errors, beyond_limits=max(float(beyond), 0.0))


@pytest.fixture(scope="module")
def outcomes(robot: RobotModel, parameters: IkParameters) -> Outcomes:
    """What every solver made of every target."""
    judge = FixedBase(robot.description)
    solvers = {
        _OURS: _ours(robot, parameters),
        _MATLAB: _ours(robot, replace(parameters, damping_bias=_MATLAB_BIAS)),
        _MINK: _mink(judge, parameters),
    }
    targets = list(_targets(robot))
    found = {}
    for name, solve in solvers.items():
        found[name, "far"] = [_try_seeds(robot, judge, solve, target, target.far) for target in targets]
        found[name, "near"] = [_try_seeds(robot, judge, solve, target, [target.near]) for target in targets]
    return found


def _missed(outcomes: list[Outcome], tries: int = _TRIES) -> float:
    """Return the share in % of targets not met within a number of tries."""
    return 100.0 * float(np.mean([not o.attempt.converged or o.tries > tries for o in outcomes]))


def _solved(outcomes: list[Outcome]) -> list[Outcome]:
    """Return the targets that were met."""
    return [outcome for outcome in outcomes if outcome.attempt.converged]


def test_targets_are_met(outcomes: Outcomes, record: Record) -> None:
    """Of a thousand targets per arm, from random seeds and from seeds near the solution."""
    against = "targets that are reachable by construction"
    record(f"missed from random seeds, up to {_TRIES} tries", _missed(outcomes[_OURS, "far"]), 0.2,
           unit="%", against=against)  # fmt: skip
    record(f"missed from within {_NEAR} rad, one try", _missed(outcomes[_OURS, "near"]), 0.1,
           unit="%", against=against)  # fmt: skip


def test_what_is_called_met_is_met(parameters: IkParameters, outcomes: Outcomes, record: Record) -> None:
    """By the forward kinematics of the other engine, which agrees with ours to rounding."""
    solved = _solved(outcomes[_OURS, "far"]) + _solved(outcomes[_OURS, "near"])
    rounding = 10 * 12 * 3 * _EPS  # ten frames, a dozen operations each, 3 m
    position = max(outcome.position_error for outcome in solved)
    angle = max(outcome.angle_error for outcome in solved)
    allowed = parameters.position_tolerance + rounding, parameters.orientation_tolerance + rounding
    against = "forward kinematics of MuJoCo"
    record("largest position error of a solution", position, allowed[0], unit="m", against=against)
    record("largest angle error of a solution", angle, allowed[1], unit="rad", against=against)


def test_limits_are_kept(outcomes: Outcomes, record: Record) -> None:
    """Whether the target is met or not."""
    worst = max(o.beyond_limits for start in ("far", "near") for o in outcomes[_OURS, start])
    record("largest excess over a joint limit", worst, 0.0, unit="rad", against="the description")


@pytest.mark.parametrize("other", [_MATLAB, _MINK])
def test_no_other_misses_less(outcomes: Outcomes, record: Record, other: str) -> None:
    """At the first try, on the same targets, by no more than chance.

    Only targets that one solver meets and the other misses count; if neither is better each of them
    falls to either with equal chance, so the difference has their root as its standard deviation.
    """
    for start, name in (("far", "random seed, one try"), ("near", f"within {_NEAR} rad, one try")):
        ours, others = (
            np.array(
                [outcome.attempt.converged and outcome.tries == 1 for outcome in outcomes[solver, start]]
            )
            for solver in (_OURS, other)
        )
        chance = 3.0 * np.sqrt(np.count_nonzero(ours != others)) / ours.size
        missed, bound = 1.0 - np.mean(ours), 1.0 - np.mean(others) + chance
        record(f"missed from {name}", 100.0 * missed, 100.0 * bound, unit="%", against=other)


def test_table_of_solvers(
    robot: RobotModel, outcomes: Outcomes, parameters: IkParameters, table: Table
) -> None:
    """What a reader compares."""
    missed = {arm: sum(o.target.arm == arm and not o.attempt.converged for o in outcomes[_OURS, "far"])
              for arm in robot.arms}  # fmt: skip
    lines = [
        f"{_TARGETS} targets per arm; tolerances {parameters.position_tolerance:g} m and "
        f"{parameters.orientation_tolerance:g} rad, at most {parameters.max_iterations} iterations per try. "
        "mink is a local differential method (a quadratic programme per iteration, unit time step). Ours "
        f"missed after {_TRIES} tries: {', '.join(f'{n} of {arm}' for arm, n in missed.items())}.",
        "",
        f"| solver | seed | met in one try | met in up to {_TRIES} tries "
        "| iterations: median, 95 % | median error [m], [rad] | largest excess over a limit [rad] |",
        "|---|---|---|---|---|---|---|",
    ]
    for (solver, start), found in outcomes.items():
        solved = _solved(found)
        counts = [outcome.attempt.iterations for outcome in solved]
        cells = [
            solver,
            "random" if start == "far" else f"within {_NEAR} rad",
            f"{100.0 - _missed(found, 1):.2f} %",
            f"{100.0 - _missed(found):.2f} %" if start == "far" else "",
            f"{np.median(counts):.0f}, {np.percentile(counts, 95):.0f}",
            f"{np.median([o.position_error for o in solved]):.0e}, "
            f"{np.median([o.angle_error for o in solved]):.0e}",
            f"{max(o.beyond_limits for o in found):.0e}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    table("\n".join(lines))
