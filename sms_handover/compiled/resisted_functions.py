"""Functions of a resisted step as CasADi expressions: what friction and wrenches need beside it."""

from collections.abc import Sequence
from typing import Any

import casadi

from sms_handover.compiled.names import FACTORS, HELD, INERTIA
from sms_handover.compiled.rigid_bodies import RigidBodies, is_zero
from sms_handover.compiled.tree import Body
from sms_handover.model.robot_model import BASE_NV

ca: Any = casadi  # its type hints are incomplete
Expression = Any  # casadi.SX
Place = tuple[int, int]

_ONE_BODY = 13  # numbers of the robot as one body: mass, first moment, inertia, linear momentum


class ResistedFunctions:
    """The functions of a step whose joints may be held.

    ``sms_inertia`` maps cosines and sines of the joint angles, v and parameters to numbers: those of the
    robot as one body, in axes of the base, then H and c. ``sms_factors`` maps numbers, what is added to the
    diagonal of H (n,) and which joints are free (n,; 1 or 0) to factors. ``sms_held`` maps numbers, factors,
    a force (6 + n,) and the accelerations (n,) of the joints that are not free to v' (6 + n,), and to what
    holds those joints beside the force (n,).
    """

    def __init__(
        self,
        turn: tuple[Expression, Expression],
        v: Expression,
        parameters: Expression,
        bodies: Sequence[Body],
    ) -> None:
        """Set up the functions of a robot whose ``bodies`` have ``parameters`` in place of numbers.

        ``turn`` has cosines and sines (n,) of the joint angles.
        """
        robot = RigidBodies(bodies, *turn, v)
        matrix, bias = robot.inertia_matrix(), robot.bias_by_points()
        size = len(matrix)
        self._joints, self._size = size - BASE_NV, size
        places = [(k, j) for k in range(size) for j in range(k + 1) if not is_zero(matrix[k][j])]
        self._at = {place: _ONE_BODY + index for index, place in enumerate(places)}
        self._linked = _filled(places, size)
        self._order = _tips_first(bodies)
        entries = [matrix[row][column] for row, column in places]
        found = ca.densify(ca.vertcat(robot.as_one_body(), *entries, bias))
        self.numbers = int(found.numel())
        self.factors = size + sum(map(len, self._linked)) + size
        self.functions = [
            ca.Function(INERTIA, [*turn, v, parameters], [ca.cse(found)]),
            self._factors_function(),
            self._held_function(),
        ]

    @property
    def diagonal(self) -> list[int]:
        """Where the diagonal of H is among the numbers, by joint."""
        return [self._at[k, k] for k in range(BASE_NV, self._size)]

    def _factors_function(self) -> Any:
        """Return the function for the factors, from the tips to the base as ``rigid_bodies.factored``.

        Those are by row, in the order in which they are found: 1 / D, D, and what D L has. A joint that is
        not free is passed over: 1 / D is 0, and its row remains, by which it pulls at the others.
        """
        numbers = ca.SX.sym("numbers", self.numbers)
        added, free = ca.SX.sym("added", self._joints), ca.SX.sym("free", self._joints)
        left = {place: numbers[index] for place, index in self._at.items()}
        found = []
        for k in self._order:
            joint = k - BASE_NV
            if joint >= 0:
                left[k, k] = left[k, k] + added[joint]
            inverse = (free[joint] if joint >= 0 else 1.0) / left[k, k]
            found += [inverse, left[k, k], *(left[k, j] for j in self._linked[k])]
            for i in self._linked[k]:
                factor = left[k, i] * inverse
                for j in self._linked[k]:
                    if j <= i:
                        left[i, j] = left.get((i, j), 0.0) - factor * left[k, j]
        return ca.Function(FACTORS, [numbers, added, free], [ca.vertcat(*found)])

    def _held_function(self) -> Any:
        """Return the function for v' under a force, and for what holds the joints that are not free."""
        size = self._size
        numbers, factors = ca.SX.sym("numbers", self.numbers), ca.SX.sym("factors", self.factors)
        force, given = ca.SX.sym("force", size), ca.SX.sym("given", self._joints)
        bias = self.numbers - size
        remaining = iter(factors[index] for index in range(self.factors))
        inverse, diagonal, rows = {}, {}, {}
        for k in self._order:
            inverse[k], diagonal[k] = next(remaining), next(remaining)
            rows[k] = {j: next(remaining) for j in self._linked[k]}
        right = [force[k] - numbers[bias + k] for k in range(size)]
        x: list[Expression] = [0.0] * size
        for k in self._order:
            x[k] = inverse[k] * right[k] + (given[k - BASE_NV] if k >= BASE_NV else 0.0)
            for j, entry in rows[k].items():
                right[j] = right[j] - entry * x[k]
        holding = []
        for k in range(size):
            pulled = ca.SX(0.0)
            for j, entry in rows[k].items():
                pulled = pulled + entry * x[j]
            x[k] = x[k] - inverse[k] * pulled
            if k >= BASE_NV:
                holding.append(pulled + diagonal[k] * given[k - BASE_NV] - right[k])
        return ca.Function(HELD, [numbers, factors, force, given], [ca.vertcat(*x), ca.vertcat(*holding)])


def _filled(places: Sequence[Place], size: int) -> list[list[int]]:
    """Return by row the columns before the diagonal that are not zero in the factors."""
    linked = [{column for row, column in places if row == k and column < k} for k in range(size)]
    for k in range(size - 1, -1, -1):
        for i in linked[k]:
            linked[i] |= {j for j in linked[k] if j < i}
    return [sorted(columns) for columns in linked]


def _tips_first(bodies: Sequence[Body]) -> list[int]:
    """Return the rows of H so that no joint comes before one that it carries.

    Joints as far from the base follow each other: they do not wait for one another, and a processor works on
    both arms at the same time.
    """
    depth = [0]
    for body in bodies[1:]:
        depth.append(depth[body.parent] + 1)
    joints = sorted(range(1, len(bodies)), key=lambda index: (-depth[index], -index))
    return [BASE_NV + index - 1 for index in joints] + [*range(BASE_NV - 1, -1, -1)]
