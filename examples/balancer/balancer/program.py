"""Program of the balancer: the quadratic program for the joint rates of a period, solved by DAQP."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import daqp
import numpy as np

import sms_handover as sms

_MOST_ITERATIONS = 300  # [-] of DAQP, of which some ten are used
_INFEASIBLE = -1  # of DAQP; others below 0 are ends without an answer
_SOFT = 8  # of DAQP: a row that may be exceeded
_BINDS = 1e-9  # [-] multiplier from which a row binds
_EXCEEDED = 1e-9  # [rad/s, m/s] from which a row is exceeded


@dataclass(frozen=True, eq=False)
class Rates:
    """What came of a program: the joint rates (n,) rad/s, empty without a solution, and what is reported.

    ``multipliers`` (n + m,) are positive where an upper bound binds; ``row`` is the one that would have to be
    exceeded most, by ``excess``, where no rates keep all bounds.
    """

    status: sms.PlanStatus
    rates: sms.Array
    multipliers: sms.Array = field(default_factory=lambda: np.zeros(0))
    iterations: int = 0
    active: tuple[str, ...] = ()
    residual: float = float("nan")
    row: str = ""
    excess: float = 0.0


class Program:
    """min sum_i |A_i w - b_i|^2_{W_i} / 2 over joint rates w (n,), under hard bounds of w and of rows C w."""

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        n = len(joint_names)
        self.hessian, self.gradient = np.zeros((n, n)), np.zeros(n)
        self.low, self.high, self.matrix = np.full(n, -np.inf), np.full(n, np.inf), np.zeros((0, n))
        self.names = [f"rate of {name}" for name in joint_names]

    def add(self, matrix: sms.Array, wanted: sms.Array, weight: sms.Array | float) -> None:
        """Add a task A w = b with rows (r, n) and weights (r,)."""
        weighted = matrix.T * weight
        self.hessian += weighted @ matrix
        self.gradient -= weighted @ wanted

    def bound(self, low: sms.Array, high: sms.Array) -> None:
        """Bound the rates themselves, (n,) rad/s each."""
        n = self.gradient.size
        self.low[:n], self.high[:n] = np.maximum(self.low[:n], low), np.minimum(self.high[:n], high)

    def keep(self, names: Sequence[str], rows: sms.Array, low: sms.Array) -> None:
        """Keep rows (r, n) from falling below bounds (r,)."""
        self.matrix = np.vstack([self.matrix, rows])
        self.low, self.high = np.append(self.low, low), np.append(self.high, np.full(low.size, np.inf))
        self.names = [*self.names, *names]

    def solve(self) -> Rates:
        """Return the rates; where no rates keep all bounds, the row that would have to be exceeded most."""
        rates, multipliers, flag, iterations = self._daqp(soft=False)
        if flag > 0:
            active = tuple(self.names[row] for row in np.flatnonzero(np.abs(multipliers) > _BINDS))
            n = self.gradient.size
            slope = self.hessian @ rates + self.gradient
            residual = slope + multipliers[:n] + self.matrix.T @ multipliers[n:]
            scaled = float(np.abs(residual).max() / max(1.0, float(np.abs(self.gradient).max())))
            return Rates(sms.PlanStatus.SOLVED, rates, multipliers, iterations, active, scaled)
        if flag != _INFEASIBLE:
            return Rates(sms.PlanStatus.ITERATION_LIMIT, np.zeros(0))
        rates, _, flag, _ = self._daqp(soft=True)
        row, excess = self._worst(rates) if flag > 0 else ("", float("nan"))
        return Rates(sms.PlanStatus.INFEASIBLE, np.zeros(0), row=row, excess=excess)

    def _daqp(self, *, soft: bool) -> tuple[sms.Array, sms.Array, int, int]:
        """Return solution, multipliers, exit flag and iterations of DAQP; rows of bounds of w come first."""
        kinds = np.full(self.low.size, _SOFT if soft else 0, dtype=np.int32)
        rates, _, flag, told = daqp.solve(
            self.hessian, self.gradient, self.matrix, self.high, self.low, kinds, iter_limit=_MOST_ITERATIONS
        )
        return np.array(rates), np.array(told["lam"]), int(flag), int(told["iterations"])

    def _worst(self, rates: sms.Array) -> tuple[str, float]:
        """Return the row whose bound rates (n,) exceed most, and by how much; '' if none."""
        values = np.concatenate([rates, self.matrix @ rates])
        excess = np.maximum(values - self.high, self.low - values)
        row = int(excess.argmax())
        return (self.names[row], float(excess[row])) if excess[row] > _EXCEEDED else ("", 0.0)
