"""Explicit commutator-free Runge-Kutta integrators on SE(3) x R^n [Celledoni2003]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

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


class _Stage(NamedTuple):
    """One stage: ``weights`` (2, i + 1) take the rows ``known`` to its motion and its velocity."""

    weights: Array
    known: Array
    combined: Array  # rows motion and velocity
    motion: Array
    velocity: Array
    origin: int
    result: Array


class LieGroupIntegrator:
    """Steps of ``h`` s of q' = v, v' = a(q, v), with q in SE(3) x R^n and v in body axes.

    With v_i and a_i the velocity and the acceleration at stage i, and (+) the exponential map of SE(3) x R^n:

        q_i = q_o (+) h sum_j (a_ij - a_oj) v_j,    v_i = v + h sum_j a_ij a_j,    o the origin of stage i
        q_next = q (+) h sum_j b_1j v_j (+) h sum_j b_2j v_j ...,    v_next = v + h sum_rj b_rj a_j

    Every sum combines v and the a_j with weights computed once, so a stage costs one product of a small
    matrix with the rows (v, a_1, a_2, ...). Joints, where (+) is a sum, follow the classical scheme. Not
    thread-safe.
    """

    def __init__(self, model: pin.Model, tableau: Tableau, h: float) -> None:
        self._model = model
        count = len(tableau.a)
        a = np.array([[*row, *[0.0] * (count - len(row))] for row in tableau.a])
        b = np.array(tableau.b)
        self._rows = np.zeros((count + 1, model.nv))  # v, then a_1, a_2, ...
        self._stages = tuple(
            self._stage(i, origin, a[i] - a[origin], a, h)
            for i, origin in enumerate(tableau.origins)
            if i > 0
        )
        ends = [_of_velocities(weights, a, h) for weights in b]
        self._end_weights = np.array([*ends, np.concatenate([[0.0], h * b.sum(axis=0)])])
        self._ends = np.zeros((len(self._end_weights), model.nv))  # the motions, then the increment of v
        *self._motions, self._increment = self._ends

    def step(self, acceleration: Acceleration, q: Array, v: Array) -> tuple[Array, Array]:
        """Return configuration (7 + n,) and velocity (6 + n,) after one step, as read-only arrays.

        ``acceleration`` is evaluated with the base at the origin: in free space it does not depend on
        the base position, and rounding is smallest there.
        """
        model, rows = self._model, self._rows
        start = q.copy()
        start[:3] = 0.0  # m
        rows[0] = v
        rows[1] = acceleration(start, v)
        configurations = [start]
        for weights, known, combined, motion, velocity, origin, result in self._stages:
            weights.dot(known, combined)
            q_stage = pin.integrate(model, configurations[origin], motion)
            configurations.append(q_stage)
            result[:] = acceleration(q_stage, velocity)
        self._end_weights.dot(rows, self._ends)
        for motion in self._motions:
            q = pin.integrate(model, q, motion)
        return frozen(q), frozen(v + self._increment)

    def _stage(self, index: int, origin: int, motion_weights: Array, a: Array, h: float) -> _Stage:
        """Return a stage with its weights and its views of the work space."""
        used = index + 1
        weights = np.array(
            [_of_velocities(motion_weights, a, h)[:used], np.concatenate([[1.0], h * a[index]])[:used]]
        )
        combined = np.zeros((2, self._rows.shape[1]))
        return _Stage(
            weights, self._rows[:used], combined, combined[0], combined[1], origin, self._rows[used]
        )


def _of_velocities(weights: Array, a: Array, h: float) -> Array:
    """Return h sum_j w_j v_j as weights of (v, a_1, a_2, ...), with v_j = v + h sum_l a_jl a_l."""
    return np.concatenate([[h * weights.sum()], h**2 * (weights @ a)])
