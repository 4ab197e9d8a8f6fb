"""Explicit commutator-free Runge-Kutta integrators on SE(3) x R^n [Celledoni2003]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from sms_handover.types import Array, frozen

Acceleration = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Tableau:
    """Butcher tableau of an explicit scheme, and the motions that compose its configurations.

    ``a`` has strictly lower rows. The configuration of stage i starts from that of stage ``origins[i]``. A
    step is a sequence of motions; their weights, the rows of ``b``, add up to those of the scheme.
    """

    order: int
    a: tuple[tuple[float, ...], ...]
    origins: tuple[int, ...]
    b: tuple[tuple[float, ...], ...]


TABLEAUS: Mapping[str, Tableau] = MappingProxyType(
    {
        "midpoint": Tableau(2, ((), (1 / 2,)), (0, 0), ((0.0, 1.0),)),
        "rk4": Tableau(
            4,
            ((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)),
            (0, 0, 0, 1),
            ((1 / 4, 1 / 6, 1 / 6, -1 / 12), (-1 / 12, 1 / 6, 1 / 6, 1 / 4)),
        ),
    }
)


class LieGroupIntegrator:
    """Steps of ``h`` s of q' = v, v' = a(q, v), with q in SE(3) x R^n and v in body axes.

    With v_i and a_i the velocity and the acceleration at stage i, and (+) the exponential map of SE(3) x R^n:

        q_i = q_o (+) h sum_j (a_ij - a_oj) v_j,    v_i = v + h sum_j a_ij a_j,    o the origin of stage i
        q_next = q (+) h sum_j b_1j v_j (+) h sum_j b_2j v_j ...,    v_next = v + h sum_rj b_rj a_j

    Every sum combines v and the a_j with weights computed once. All sums grow together, by one row (v, a_1,
    a_2, ...) after the other, so their order is fixed. Joints, where (+) is a sum, follow the classical
    scheme. Not thread-safe.
    """

    def __init__(self, model: pin.Model, tableau: Tableau, h: float) -> None:
        self._model = model
        count = len(tableau.a)
        a = np.array([[*row, *[0.0] * (count - len(row))] for row in tableau.a])
        b = np.array(tableau.b)
        motions = [_of_velocities(a[i] - a[origin], a, h) for i, origin in enumerate(tableau.origins)][1:]
        velocities = [np.concatenate([[1.0], h * row]) for row in (*a[1:], b.sum(axis=0))]
        ends = [_of_velocities(weights, a, h) for weights in b]
        weights = np.array([*motions, *ends, *velocities]).T
        # For each of v, a_1, a_2, ... its weights, spread out: NumPy is three times as fast on equal shapes.
        self._weights = tuple(np.repeat(row[:, np.newaxis], model.nv, axis=1) for row in weights)
        self._sums, self._term, self._row = np.zeros((3, weights.shape[1], model.nv))
        *velocity_of, self._end_velocity = self._sums[-count:]
        self._ends = tuple(self._sums[count - 1 : -count])
        self._stages = tuple(
            zip(tableau.origins[1:], self._sums[: count - 1], velocity_of, self._weights[2:], strict=True)
        )

    def step(self, acceleration: Acceleration, q: Array, v: Array) -> tuple[Array, Array]:
        """Return configuration (7 + n,) and velocity (6 + n,) after one step, as read-only arrays.

        ``acceleration`` is evaluated with the base at the origin: in free space it does not depend on
        the base position, and rounding is smallest there.
        """
        model, sums, term, row = self._model, self._sums, self._term, self._row
        multiply, add = np.multiply, np.add
        start = q.copy()
        start[:3] = 0.0  # m
        configurations = [start]
        row[:] = v
        multiply(self._weights[0], row, sums)
        row[:] = acceleration(start, v)
        multiply(self._weights[1], row, term)
        add(sums, term, sums)
        for origin, motion, velocity, weights in self._stages:
            q_stage = pin.integrate(model, configurations[origin], motion)
            configurations.append(q_stage)
            row[:] = acceleration(q_stage, velocity)
            multiply(weights, row, term)
            add(sums, term, sums)
        for motion in self._ends:
            q = pin.integrate(model, q, motion)
        return frozen(q), frozen(self._end_velocity.copy())


def _of_velocities(weights: Array, a: Array, h: float) -> Array:
    """Return h sum_j w_j v_j as weights of (v, a_1, a_2, ...), with v_j = v + h sum_l a_jl a_l."""
    return np.concatenate([[h * weights.sum()], h**2 * (weights @ a)])
