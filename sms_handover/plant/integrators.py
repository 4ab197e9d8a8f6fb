"""Explicit Runge-Kutta-Munthe-Kaas integrators on SE(3) x R^n [MuntheKaas1999]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NV
from sms_handover.types import Array

Acceleration = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Tableau:
    """Butcher tableau of an explicit Runge-Kutta scheme: strictly lower rows ``a``, weights ``b``."""

    order: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]


TABLEAUS: Mapping[str, Tableau] = MappingProxyType(
    {
        "midpoint": Tableau(2, ((), (1 / 2,)), (0.0, 1.0)),
        "rk4": Tableau(4, ((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    }
)


def rkmk_step(
    model: pin.Model, tableau: Tableau, acceleration: Acceleration, q: Array, v: Array, h: float
) -> tuple[Array, Array]:
    """Return configuration and velocity after one step of ``h`` s.

    With q(t) = q0 (+) u(t), the base part of u lives in se(3) and obeys
    u' = dexpinv_{-u}(v); each stage evaluates v' = ``acceleration(q, v)`` at q0 (+) u_i.
    Shapes: ``q`` (7 + n,), ``v`` (6 + n,). The order is the tableau's, up to 4.
    """
    tangents = np.empty((len(tableau.a), v.size))  # rows u'_i
    slopes = np.empty_like(tangents)  # rows v'_i
    for stage, row in enumerate(tableau.a):
        if row:
            weights = h * np.array(row)
            u = weights @ tangents[:stage]
            v_stage = v + weights @ slopes[:stage]
            q_stage = pin.integrate(model, q, u)
            tangents[stage] = v_stage
            tangents[stage, :BASE_NV] = _inverse_differential(
                u[:BASE_NV].tolist(), v_stage[:BASE_NV].tolist()
            )
        else:
            q_stage, v_stage = q, v
            tangents[stage] = v
        slopes[stage] = acceleration(q_stage, v_stage)
    weights = h * np.array(tableau.b)
    q_next: Array = pin.integrate(model, q, weights @ tangents)
    return q_next, v + weights @ slopes


def _inverse_differential(u: list[float], v: list[float]) -> list[float]:
    """Return dexpinv_{-u}(v) = v + [u, v]/2 + [u, [u, v]]/12 for two twists, linear part first.

    The next term is of fourth order in u, so a step keeps order 4. Plain floats: for six numbers
    they are several times faster than arrays.
    """
    first = _bracket(u, v)
    second = _bracket(u, first)
    return [x + 0.5 * y + z / 12.0 for x, y, z in zip(v, first, second, strict=True)]


def _bracket(a: list[float], b: list[float]) -> list[float]:
    """Return the Lie bracket of two twists: (w_a x v_b - w_b x v_a, w_a x w_b)."""
    ax, ay, az, ap, aq, ar = a
    bx, by, bz, bp, bq, br = b
    return [
        aq * bz - ar * by - bq * az + br * ay,
        ar * bx - ap * bz - br * ax + bp * az,
        ap * by - aq * bx - bp * ay + bq * ax,
        aq * br - ar * bq,
        ar * bp - ap * br,
        ap * bq - aq * bp,
    ]
