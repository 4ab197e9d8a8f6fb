"""Turns about axes of a frame as CasADi expressions: those of joints, and those of a mount."""

from dataclasses import replace
from typing import Any

import casadi
import numpy as np

from sms_handover.compiled.tree import Body, coordinate_axis

ca: Any = casadi  # its type hints are incomplete
Expression = Any  # casadi.SX


def turned_about_axis(body: Body, cosine: Expression, sine: Expression) -> Expression:
    """Return the rotation about the axis of a joint by Rodrigues' formula."""
    cross, along = np.array(ca.skew(body.axis)), np.outer(body.axis, body.axis)
    return cosine * ca.SX(np.eye(3) - along) + sine * ca.SX(cross) + ca.SX(along)


def turn_matrix(axis: int, cosine: Expression, sine: Expression) -> Expression:
    """Return the rotation about an axis of the frame."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = ca.SX.eye(3)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[j, i], matrix[i, j] = sine, -sine
    return matrix


def joined(body: Body, cosine: Expression, sine: Expression) -> tuple[Body, tuple[Expression, Expression]]:
    """Return a body, and cosine and sine of its joint.

    A mount's turn about the axis of the joint is where the angle of the joint begins.
    """
    axis = coordinate_axis(body)
    if not body.turns or axis is None:
        return body, (cosine, sine)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    first, second = body.rotation[i, i], body.rotation[j, i]
    turn = first * cosine - second * sine, second * cosine + first * sine
    return replace(body, rotation=np.eye(3)), turn


def turned_from_mount(body: Body, matrix: Expression) -> Expression:
    """Return a matrix that is in axes of a mount in those of the parent."""
    for turn in reversed(body.turns):
        matrix = conjugated(matrix, *turn)
    return matrix


def conjugated(matrix: Expression, axis: int, cosine: Expression, sine: Expression) -> Expression:
    """Return R M R^T for a turn R about an axis of the frame.

    The turn changes neither the trace of the block across the axis nor the difference of its other two
    entries, so that half of the block is enough.
    """
    i, j, k = (axis + 1) % 3, (axis + 2) % 3, axis
    found, turn = ca.SX(matrix), turn_matrix(axis, cosine, sine)
    row, column = turn @ matrix[:, k], matrix[k, :] @ turn.T
    first, second = (cosine * matrix[i, at] - sine * matrix[j, at] for at in (i, j))
    found[:, k], found[k, :], found[k, k] = row, column, matrix[k, k]
    found[i, i], found[i, j] = cosine * first - sine * second, sine * first + cosine * second
    found[j, j] = matrix[i, i] + matrix[j, j] - found[i, i]
    found[j, i] = found[i, j] - (matrix[i, j] - matrix[j, i])
    return found
