"""Tumbling from random states: ours against MuJoCo.

Both integrate the same equations with four stages of order four: joints and base must tend to the
same motion as the step falls, and no engine may lose momentum faster than the other.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from benchmarks.states import apart, order
from sms_handover.engines.mujoco_robot import MujocoRobot, State
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.types import Array
from test.evidence import Record, Table

_MOTIONS = 24
_TIME = 1.0  # [s]
_COUNTS = (100, 200, 400, 800)  # steps in that time
_ASKED = 1e-8  # [m, rad] agreement that is asked for
_ORDER_TOLERANCE = 0.1  # [-] what is asked of a measured order
_AGAINST = f"MuJoCo {mujoco.__version__}"

Advance = Callable[[State, Array, int], State]


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a motion starts, and where it ends in either engine for every number of steps."""

    start: State
    ours: list[State]
    mujoco: list[State]


def _ours(robot: RobotModel) -> Advance:
    """Return a function that lets our robot move for the time in a number of steps."""

    def advance(start: State, effort: Array, count: int) -> State:
        generalized = np.concatenate([np.zeros(6), effort])

        def acceleration(q: Array, v: Array) -> Array:
            return np.asarray(pin.aba(robot.pin, robot.data, q, v, generalized))

        q, v = start
        integrator = LieGroupIntegrator(robot.pin, TABLEAUS["rk4"], _TIME / count)
        for _ in range(count):
            q, v = integrator.step(acceleration, q, v)
        return q, v

    return advance


def _mujoco(robot: RobotModel) -> Advance:
    """Return the same for MuJoCo."""
    other = MujocoRobot.of(robot.description)

    def advance(start: State, effort: Array, count: int) -> State:
        other.place(*start)
        other.drive(effort)
        other.advance(_TIME / count, count)
        return other.state

    return advance


def _start(robot: RobotModel, random: np.random.Generator, *, driven: bool) -> tuple[State, Array]:
    """Return a random state, and efforts that accelerate the joints by up to about 1 rad/s^2, or none."""
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    q = np.concatenate([random.uniform(-1.0, 1.0, 3), quaternion, random.uniform(low, high)])
    v = random.uniform(-1.0, 1.0, 6 + robot.n_joints)
    wanted = random.uniform(-1.0, 1.0, robot.n_joints) if driven else np.zeros(robot.n_joints)
    return (q, v), np.asarray(reduced_dynamics(robot, q, np.zeros_like(v)).inertia @ wanted)


def _drift(robot: RobotModel, start: State, end: State) -> tuple[float, float]:
    """Return by how much linear and angular momentum differ between two states."""
    before, after = conserved_quantities(robot, *start), conserved_quantities(robot, *end)
    linear = np.linalg.norm(after.linear_momentum - before.linear_momentum)
    return float(linear), float(np.linalg.norm(after.angular_momentum - before.angular_momentum))


def _limit(coarse: State, fine: State, measured_order: float) -> State:
    """Return the state at step zero by Richardson's extrapolation of two, one with half the step."""
    share = 1.0 / (2.0 ** round(measured_order) - 1.0)
    same_side = np.ones_like(fine[0])
    same_side[3:7] = np.sign(fine[0][3:7] @ coarse[0][3:7])  # a quaternion and its negative are one attitude
    q = fine[0] + share * (fine[0] - same_side * coarse[0])
    q[3:7] /= np.linalg.norm(q[3:7])
    return q, fine[1] + share * (fine[1] - coarse[1])


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture(scope="module")
def motions(robot: RobotModel) -> list[Motion]:
    """The same motions in both engines."""
    random = np.random.default_rng(2)
    found = []
    for index in range(_MOTIONS):
        start, effort = _start(robot, random, driven=index % 2 == 1)
        ours, others = (
            [run(start, effort, count) for count in _COUNTS] for run in (_ours(robot), _mujoco(robot))
        )
        found.append(Motion(start, ours, others))
    return found


def _orders(ends: list[list[State]]) -> Array:
    """Return the measured orders of joints, base position and base angle: median over the motions."""
    changes = [np.array([apart(a, b) for a, b in pairwise(states)]) for states in ends]
    return np.asarray(np.median([order(change) for change in changes], axis=0))


def test_ours_converges_with_order_four(motions: list[Motion], record: Record) -> None:
    """Halving the step divides the change of the result by 16, in the joints and on the base's manifold."""
    names = ("joints", "base position", "base attitude")
    for name, measured in zip(names, _orders([motion.ours for motion in motions]), strict=True):
        record(f"order of {name}: distance from 4", abs(measured - 4.0), _ORDER_TOLERANCE,
               against="theory")  # fmt: skip


def test_both_engines_tend_to_the_same_motion(motions: list[Motion], record: Record) -> None:
    """Extrapolated to step zero by the order that each engine shows, they agree in every coordinate.

    The joints move alike at any step already: their accelerations do not depend on how the base
    translates, so both engines apply the same scheme to the same equations.
    """
    of_the_base = min(_orders([motion.mujoco for motion in motions])[1:])
    largest, joints = np.zeros(3), 0.0
    for motion in motions:
        ours, others = motion.ours, motion.mujoco
        limits = _limit(ours[-2], ours[-1], 4.0), _limit(others[-2], others[-1], of_the_base)
        largest = np.maximum(largest, apart(*limits))
        joints = max(joints, *(apart(a, b)[0] for a, b in zip(ours, others, strict=True)))
    record("joints at equal step, any step", joints, _ASKED, unit="rad", against=_AGAINST)
    record("base position as the step falls", largest[1], _ASKED, unit="m", against=_AGAINST)
    record("base attitude as the step falls", largest[2], _ASKED, unit="rad", against=_AGAINST)


def test_ours_loses_no_more_momentum(robot: RobotModel, motions: list[Motion], record: Record) -> None:
    """Over random motions the mean of log(our drift / MuJoCo's) is not above zero by three standard errors.

    Linear momentum differs by a few per cent either way from motion to motion, since we integrate
    the velocity of the base in its own axes and MuJoCo in those of the world.
    """
    ratios = []
    for motion in motions:
        for a, b in zip(motion.ours, motion.mujoco, strict=True):
            ours, others = (np.array(_drift(robot, motion.start, end)) for end in (a, b))
            ratios.append(np.log(ours / others))
    means, errors = np.mean(ratios, axis=0), np.std(ratios, axis=0) / np.sqrt(len(ratios))
    for name, mean, error in zip(("linear", "angular"), means, errors, strict=True):
        record(
            f"drift of {name} momentum, ours / MuJoCo's", np.exp(mean), np.exp(3.0 * error), against=_AGAINST
        )


def test_table_of_steps(robot: RobotModel, motions: list[Motion], table: Table) -> None:
    """What a reader compares: agreement and momentum at every step, the worst of all motions."""
    conserved = [conserved_quantities(robot, *motion.start) for motion in motions]
    linear, angular = (
        max(float(np.linalg.norm(getattr(each, name))) for each in conserved)
        for name in ("linear_momentum", "angular_momentum")
    )
    lines = [
        f"{_MOTIONS} random motions of {_TIME:g} s, half of them driven; the worst of all. Their momenta are "
        f"up to {linear:.0f} kg m/s and {angular:.0f} kg m^2/s.",
        "",
        "| step [ms] | ours - MuJoCo: joints [rad] | base [m] | base [rad] "
        "| momentum drift, ours [kg m/s, kg m^2/s] | MuJoCo |",
        "|---|---|---|---|---|---|",
    ]
    for index, count in enumerate(_COUNTS):
        difference = np.max([apart(motion.ours[index], motion.mujoco[index]) for motion in motions], axis=0)
        drifts = [
            np.max(
                [_drift(robot, motion.start, end) for motion, end in zip(motions, ends, strict=True)], axis=0
            )
            for ends in (
                [motion.ours[index] for motion in motions],
                [motion.mujoco[index] for motion in motions],
            )
        ]
        cells = [f"{1e3 * _TIME / count:g}", *(f"{x:.1e}" for x in difference)]
        cells += [f"{linear:.2e}, {angular:.2e}" for linear, angular in drifts]
        lines.append("| " + " | ".join(cells) + " |")
    ours, others = (
        ", ".join(f"{x:.2f}" for x in _orders(ends))
        for ends in ([motion.ours for motion in motions], [motion.mujoco for motion in motions])
    )
    lines += ["", f"Measured order (joints, base position, base attitude): ours {ours}; {_AGAINST} {others}."]
    table("\n".join(lines))
