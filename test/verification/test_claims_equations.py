"""The paper's printed equations against what holds.

docs/equations.md goes through them one by one; here is measured what it says. Equations are numbered
in the order of the paper's source, so (12) is the Lagrangian and (15) the block form.
"""

from collections.abc import Iterator

import numpy as np
import pytest

from sms_handover.control.law import LinearFeedback
from sms_handover.control.nmpc import NmpcGains
from sms_handover.control.pid import PidGains, linearised
from sms_handover.control.stability import loop_stability
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array
from test.core.conftest import Draw
from test.evidence import Record, Table
from test.verification.lagrangian import Lagrangian, Motion

_STATES = 20
_ARM = 7  # joints of an arm
_EPS = float(np.finfo(float).eps)
_ROUNDING = 10 * 12 * _EPS * 12.0  # as in test_lagrangian: ten frames, a dozen operations, cond(E)^2
_AGAINST = "Lagrangian in Euler angles, CasADi"


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture(scope="module")
def motions(robot: RobotModel) -> list[Motion]:
    """H and c at random states, by the second method."""
    return list(_motions(robot.description, Draw(robot, seed=7)))


def _motions(description: RobotDescription, draw: Draw) -> Iterator[Motion]:
    lagrangian = Lagrangian(description)
    for _ in range(_STATES):
        q = np.concatenate([draw.vector(6), draw.joints()])
        yield lagrangian.motion(q, draw.v())


def _reduced(inertia: Array) -> Array:
    """Return H*, the inverse of the joint block of H^-1."""
    return np.array(np.linalg.inv(np.linalg.inv(inertia)[BASE_NV:, BASE_NV:]))


def test_blocks_of_the_mass_matrix(motions: list[Motion], robot: RobotModel, record: Record) -> None:
    """The arms meet in the base only; the lower left block is a transpose; H_b has all the mass."""
    a, b = slice(BASE_NV, BASE_NV + _ARM), slice(BASE_NV + _ARM, None)
    across = max(float(np.max(np.abs(motion.inertia[a, b]))) for motion in motions)
    record(
        "(15): largest entry of the block of H between the arms", across, 0.0, unit="kg m^2", against=_AGAINST
    )
    off = max(
        float(np.max(np.abs(motion.inertia[BASE_NV:, :BASE_NV] - motion.inertia[:BASE_NV, BASE_NV:].T)))
        for motion in motions
    )
    record("(15): lower left block off the transpose of H_bm", off, 254.0 * _ROUNDING, against=_AGAINST)
    whole = max(abs(float(motion.inertia[0, 0]) - robot.mass) for motion in motions)
    claim = "(15): first entry of H_b off the mass of the whole robot"
    record(claim, whole, 254.0 * _ROUNDING, unit="kg", against=_AGAINST)


def test_rates_of_the_other_arm(robot: RobotModel, record: Record) -> None:
    """The velocity terms of an arm do not depend on the rates of the other; those of H* do."""
    lagrangian, draw = Lagrangian(robot.description), Draw(robot, seed=9)
    own, reduced = 0.0, np.inf
    for _ in range(_STATES):
        q, v = np.concatenate([draw.vector(6), draw.joints()]), draw.v()
        other = np.concatenate([v[: BASE_NV + _ARM], draw.vector(_ARM)])
        first, second = lagrangian.motion(q, v), lagrangian.motion(q, other)
        change = second.bias - first.bias
        size = float(np.linalg.norm(first.bias[BASE_NV : BASE_NV + _ARM]))
        own = max(own, float(np.linalg.norm(change[BASE_NV : BASE_NV + _ARM])) / size)
        free = _reduced(first.inertia) @ np.linalg.solve(first.inertia, change)[BASE_NV:]
        reduced = min(reduced, float(np.linalg.norm(free[:_ARM])) / size)
    claim = "(15): change of c_m of an arm with the rates of the other arm, relative"
    record(claim, own, 3.0 * _ROUNDING, against=_AGAINST)
    claim = "(15): largest such change of c_m by the smallest one of c*, which has them"
    record(claim, own / reduced, 1e-6, against=_AGAINST)


def test_signs_of_the_laws(robot: RobotModel, record: Record) -> None:
    """With e = q - q_d both laws have to push against the error."""
    q = robot.configuration(Draw(robot, seed=7).pose(), np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2))
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    feedback = linearised(PidGains(2.0, 1.0, 1.5), inertia)
    radius = loop_stability(inertia, feedback, 1e-3, robot.joint_names).spectral_radius
    claim = "(17): spectral radius of the sampled loop under u = -(K_P e + ...), less 1"
    record(claim, radius - 1.0, -1e-9, against="stability of a linear loop")


def test_the_table_of_equations(motions: list[Motion], robot: RobotModel, table: Table) -> None:
    """What is printed, what holds, and how much it matters on this robot."""
    arms = sum(arm.mass for arm in robot.description.arms)
    coupling, wrong = [], []
    random = np.random.default_rng(8)
    for motion in motions:
        reduced = _reduced(motion.inertia)
        own = np.sqrt(np.diag(reduced))
        coupling.append(np.max(np.abs(reduced[:_ARM, _ARM:] / np.outer(own[:_ARM], own[_ARM:]))))
        wanted = random.uniform(-1.0, 1.0, 2 * _ARM)
        found = np.linalg.solve(reduced, motion.inertia[BASE_NV:, BASE_NV:] @ wanted)
        wrong.append(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
    gains = NmpcGains(1.0, 0)
    runaway = np.max(np.roots([1.0, -gains.velocity_gain, -gains.position_gain]).real)
    rows = [
        "| equation | printed | holds | measured |",
        "|---|---|---|---|",
        f"| (12) | bodies 1 to n of each arm | the base too | {arms:.4g} kg instead of {robot.mass:.4g} kg |",
        "| (15) | zero blocks between the arms | in H yes, in H* not | H: 0; H*: up to "
        f"{np.max(coupling):.2g} of sqrt(H*_ii H*_jj) |",
        "| (15) | lower left H_bm | its transpose | 14 x 6, printed as 6 x 7 each |",
        f"| (15) | H_b of the base | of the whole robot, a function of q | {robot.mass:.4g} kg, not "
        f"{robot.description.base.inertia.mass:.4g} kg |",
        f"| (17) | u = K_P e + ..., e = q - q_d | u = -(K_P e + ...) | printed: grows as "
        f"exp({_printed_pid(robot):.3g} t); ours: decays |",
        "| (19) | H is 20 x 20, u has 14 entries | H*, c* of the arms on the free base | with the arms' own "
        f"H_m accelerations are off by {100 * np.median(wrong):.2g} % in the median, "
        f"{100 * np.max(wrong):.2g} % at most |",
        f"| (19) | with e = q_d - q | e = q - q_d | would grow as exp({runaway:.3g} t) at T_r = 1 s |",
        "| (19) | H q'' | H q_d'' | as printed q'' cancels with (14) and u with it |",
    ]
    table(f"Measured at {_STATES} random states of the shipped robot.\n\n" + "\n".join(rows))


def _printed_pid(robot: RobotModel) -> float:
    """Return the largest growth rate in 1/s of the frozen loop with the sign that (17) prints."""
    q = robot.configuration(Draw(robot, seed=7).pose(), np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2))
    inertia = reduced_dynamics(robot, q, np.zeros(20)).inertia
    printed = LinearFeedback(*(-gain * np.eye(14) for gain in (2.0, 1.5, 1.0)))
    pull = np.linalg.solve(inertia, np.hstack([printed.position, printed.velocity, printed.integral]))
    zero, one = np.zeros((14, 14)), np.eye(14)
    system = np.vstack([np.hstack([zero, one, zero]), -pull, np.hstack([one, zero, zero])])
    return float(np.max(np.linalg.eigvals(system).real))
