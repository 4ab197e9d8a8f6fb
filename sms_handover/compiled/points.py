"""Accelerations of the points of a body as CasADi expressions, and the moment that they take."""

from typing import Any

import casadi

ca: Any = casadi  # its type hints are incomplete
Expression = Any  # casadi.SX


def gradient_of(spin: Expression, gained: Expression) -> Expression:
    """Return [w'] + [w][w] (3, 3)."""
    x, y, z = (spin[index] for index in range(3))
    across = ca.blockcat(
        [[-(y * y + z * z), x * y, x * z], [x * y, -(x * x + z * z), y * z], [x * z, y * z, -(x * x + y * y)]]
    )
    return across + ca.skew(gained)


def turning_moment(
    inertia: Expression, spin: Expression, gained: Expression, gradient: Expression
) -> Expression:
    """Return I w' + w x (I w), which shares products with the gradient of the acceleration."""
    parts = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        own = inertia[i, i] * gained[i] + (inertia[k, k] - inertia[j, j]) * (spin[j] * spin[k])
        unlike = (spin[j] * spin[j] - spin[k] * spin[k]) * inertia[j, k]
        parts.append(own + unlike - gradient[k, i] * inertia[i, j] + gradient[j, i] * inertia[i, k])
    return ca.vertcat(*parts)
