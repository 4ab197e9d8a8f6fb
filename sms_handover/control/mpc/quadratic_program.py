"""Quadratic program of one iteration, solved by DAQP, a dual active-set method [Arnstrom2022]."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from sms_handover.control.mpc.constraints import Constraint
from sms_handover.control.mpc.products import times_vector
from sms_handover.errors import ControllerError, MissingDependencyError
from sms_handover.plan_report import PlanStatus
from sms_handover.types import Array

_HARD, _SOFT = 0, 8  # of DAQP
_INFEASIBLE, _ENDLESS = -1, (-2, -4)  # flags of DAQP; the latter where it cycles, and after all iterations
_SOFTNESS = 1e-8  # [-] slack of a scaled row per multiplier: rows are exceeded by about a thousandth
_BINDS = 1e-9  # [-] multiplier from which a row binds
_EXCEEDED = 1e-9  # [-] of the scale of a row, from which it is exceeded


@dataclass(frozen=True, eq=False)
class Solution:
    """Changes of the accelerations (N n,), empty unless ``status`` is SOLVED, and what is reported."""

    status: PlanStatus
    change: Array
    iterations: int
    active: tuple[str, ...]
    largest_slack: float
    largest_slack_row: str
    kkt_residual: float


def require_daqp() -> Any:
    """Return the solver; raises MissingDependencyError where it is not installed."""
    try:
        return import_module("daqp")
    except ImportError as error:
        if error.name != "daqp":
            raise
        raise MissingDependencyError("predictive control laws", "daqp", "mpc") from error


def solve(
    hessian: Array, gradient: Array, constraints: Sequence[Constraint], most_iterations: int
) -> Solution:
    """Return the minimum of x^T P x / 2 + g^T x under the constraints, with slack where a row is soft.

    Without a solution that keeps the hard rows the one is named that would have to be exceeded most; without
    one after all iterations, the soft one that is exceeded most without a change. Raises
    ControllerError on a program that is not convex or not finite, which no state of a robot makes.
    """
    matrix = np.vstack([item.matrix for item in constraints])
    high = np.concatenate([item.high - item.value for item in constraints])
    low = np.concatenate([item.low - item.value for item in constraints])
    kinds = [np.full(len(item.value), _SOFT if item.soft else _HARD, dtype=np.int32) for item in constraints]
    change, multipliers, flag, iterations = _daqp(
        hessian, gradient, matrix, high, low, np.concatenate(kinds), most_iterations
    )
    if flag > 0 and np.isfinite(change).all():
        active = _active(constraints, multipliers)
        slack, row = worst_excess(constraints, change, soft=True)
        residual = times_vector(hessian, change) + gradient + times_vector(matrix.T, multipliers)
        scaled = float(np.abs(residual).max() / max(1.0, float(np.abs(gradient).max())))
        return Solution(PlanStatus.SOLVED, change, iterations, active, slack, row, scaled)
    nothing = np.zeros(0)
    if flag in _ENDLESS:
        slack, row = worst_excess(constraints, np.zeros(len(gradient)), soft=True)
        return Solution(PlanStatus.ITERATION_LIMIT, nothing, iterations, (), slack, row, float("nan"))
    if flag != _INFEASIBLE:
        raise ControllerError(
            f"control law 'mpc': DAQP ended with flag {flag} and {np.isnan(hessian).sum()} numbers of the "
            "Hessian are not finite, expected a convex and finite program: the state or a weight is wrong"
        )
    softened = np.full(len(high), _SOFT, dtype=np.int32)
    change, _, flag, _ = _daqp(hessian, gradient, matrix, high, low, softened, most_iterations)
    slack, row = worst_excess(constraints, change, soft=False) if flag > 0 else (float("nan"), "")
    return Solution(PlanStatus.INFEASIBLE, nothing, iterations, (), slack, row, float("nan"))


def _daqp(
    hessian: Array, gradient: Array, matrix: Array, high: Array, low: Array, kinds: Any, most: int
) -> tuple[Array, Array, int, int]:
    """Return solution, multipliers, exit flag and iterations of DAQP."""
    solver = require_daqp()
    change, _, flag, told = solver.solve(
        hessian, gradient, matrix, high, low, kinds, iter_limit=most, rho_soft=_SOFTNESS
    )
    return np.array(change), np.array(told["lam"]), int(flag), int(told["iterations"])


def _active(constraints: Sequence[Constraint], multipliers: Array) -> tuple[str, ...]:
    """Return the names of the rows that bind at any instant, in their order."""
    names = [name for item in constraints for name in item.names]
    binding = np.flatnonzero(np.abs(multipliers) > _BINDS)
    return tuple(dict.fromkeys(names[row] for row in binding.tolist()))


def worst_excess(constraints: Sequence[Constraint], change: Array, *, soft: bool) -> tuple[float, str]:
    """Return by how much the worst soft or hard limit is exceeded, in its unit, and the name of its row."""
    worst, found = _EXCEEDED, (0.0, "")
    for item in constraints:
        if item.soft is not soft:
            continue
        value = item.value + times_vector(item.matrix, change)
        excess = np.maximum(value - item.limit_high, item.limit_low - value)
        share = excess / item.scale
        row = int(share.argmax())
        if share[row] > worst:
            worst, found = float(share[row]), (float(excess[row]), item.names[row])
    return found
