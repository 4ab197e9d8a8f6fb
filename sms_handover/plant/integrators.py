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
    tangents: list[Array] = []
    slopes: list[Array] = []
    for row in tableau.a:
        if row:
            u = h * _combine(row, tangents)
            v_stage = v + h * _combine(row, slopes)
            q_stage = pin.integrate(model, q, u)
            tangents.append(_inverse_differential(u, v_stage))
        else:
            v_stage, q_stage = v, q
            tangents.append(v)
        slopes.append(acceleration(q_stage, v_stage))
    q_next: Array = pin.integrate(model, q, h * _combine(tableau.b, tangents))
    return q_next, v + h * _combine(tableau.b, slopes)


def _combine(weights: tuple[float, ...], vectors: list[Array]) -> Array:
    """Return the weighted sum of vectors, leaving out the zero weights."""
    return sum(w * x for w, x in zip(weights, vectors, strict=True) if w)  # type: ignore[return-value]


def _inverse_differential(u: Array, v: Array) -> Array:
    """Return dexpinv_{-u}(v) = v + [u, v]/2 + [u, [u, v]]/12 on the base part; joints are flat.

    The next term is of fourth order in u, so a step keeps order 4.
    """
    base_u = pin.Motion(u[:BASE_NV])
    bracket = base_u ^ pin.Motion(v[:BASE_NV])
    result: Array = np.array(v)
    result[:BASE_NV] += 0.5 * bracket.vector + (base_u ^ bracket).vector / 12.0
    return result
