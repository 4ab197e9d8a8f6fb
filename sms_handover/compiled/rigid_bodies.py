"""Rigid bodies: the dynamics of a free-floating tree as CasADi expressions [Featherstone2008].

Vectors are in the frame of their body. A wrench is a force and a moment about the origin of the frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi

from sms_handover.compiled.points import gradient_of, turning_moment
from sms_handover.compiled.tree import Body, coordinate_axis
from sms_handover.compiled.turns import conjugated, joined, turn_matrix, turned_about_axis, turned_from_mount
from sms_handover.model.robot_model import BASE_NV

ca: Any = casadi  # its type hints are incomplete
Expression = Any  # casadi.SX


@dataclass(frozen=True, eq=False)
class _Rigid:
    """Mass, first moment and inertia about the origin of a body, or of a composite body."""

    mass: float
    first_moment: Expression
    inertia: Expression

    def wrench(self, linear: Expression, angular: Expression) -> tuple[Expression, Expression]:
        """Return the momentum of a twist, or the wrench that an acceleration takes."""
        force = self.mass * linear + ca.cross(angular, self.first_moment)
        return force, self.inertia @ angular + ca.cross(self.first_moment, linear)


class RigidBodies:
    """The equations of motion H(q) v' + c(q, v) = (0, u) at joint angles and a velocity v (6 + n,).

    In free space H, c and hence v' do not depend on the base pose.
    """

    def __init__(self, bodies: Sequence[Body], cosines: Expression, sines: Expression, v: Expression) -> None:
        """Set up expressions of cosines (n,) and sines (n,) of the joint angles."""
        joints = zip(bodies[1:], _elements(cosines), _elements(sines), strict=True)
        found = [joined(*joint) for joint in joints]
        self._bodies = [bodies[0], *(body for body, _ in found)]
        self._turns = [turn for _, turn in found]
        self._rigids = [_Rigid(body.mass, ca.SX(body.first_moment), ca.SX(body.inertia)) for body in bodies]
        self._rates = [v[BASE_NV + joint] for joint in range(len(bodies) - 1)]
        self._rotations = [ca.SX.eye(3)]  # of each body in its parent
        self._twists = [(v[:3], v[3:BASE_NV])]
        for body, turn, rate in zip(self._bodies[1:], self._turns, self._rates, strict=True):
            self._rotations.append(ca.SX(body.rotation) @ turned_about_axis(body, *turn))
            linear, angular = self._carried(len(self._twists), *self._twists[body.parent])
            self._twists.append((linear, angular + ca.SX(body.axis) * rate))
        self._composites = self._composed()

    def joint_efforts(self, joint_acceleration: Expression) -> Expression:
        """Return u (n,) N m that brings about joint accelerations (n,), as ``reduced_inverse_dynamics``.

        A base at rest would need the wrench f_b; without it the base accelerates by a_b = -H_b^-1 f_b, and
        u = H_m q_m'' + c_m + H_mb a_b. H and c are those of :meth:`acceleration`, so that both share them.
        """
        matrix, wanted = self.inertia_matrix(), _elements(joint_acceleration)
        forces = _elements(self.bias())
        for row, entries in enumerate(matrix):
            forces[row] = forces[row] + _product(entries[BASE_NV:], wanted)
        yielding = substituted(factored(self._base_inertia()), -ca.vertcat(*forces[:BASE_NV]))
        rows = zip(forces[BASE_NV:], matrix[BASE_NV:], strict=True)
        return ca.vertcat(*(own + _product(row[:BASE_NV], _elements(yielding)) for own, row in rows))

    def acceleration(self, force: Expression) -> Expression:
        """Return v' (6 + n,) under a wrench on the base and joint efforts (6 + n,), from H v' = f - c."""
        return substituted(factored(self.inertia_matrix()), force - self.bias())

    def bias(self) -> Expression:
        """Return c (6 + n,)."""
        wrenches = self._wrenches([0.0] * len(self._rates))
        bias = [
            ca.dot(ca.SX(body.axis), moment)
            for body, (_, moment) in zip(self._bodies[1:], wrenches[1:], strict=True)
        ]
        return ca.vertcat(*wrenches[0], *bias)

    def bias_by_points(self) -> Expression:
        """Return the same with fewer operations, by accelerations of points in place of those of bodies.

        A point x of a body accelerates by a + U x, with U = [w'] + [w][w] for its angular velocity w
        [Khalil2004]. A body of mass m, first moment h and inertia I takes m a + U h, and about its origin
        h x a + I w' + w x (I w).
        """
        still, base = ca.SX.zeros(3), self._twists[0]
        motions, wrenches = [(still, ca.cross(base[1], base[0]))], []  # w' and a
        for index, body in enumerate(self._bodies):
            spin = self._twists[index][1]
            if index:
                vectors = [self._twists[body.parent][1], *motions[body.parent]]
                for turn in body.turns:
                    vectors = [turn_matrix(*turn).T @ vector for vector in vectors]
                before, gained, moved = vectors
                into, axis = self._rotations[index].T, ca.SX(body.axis)
                moved = into @ (moved + gradient_of(before, gained) @ ca.SX(body.place))
                motions.append((into @ gained + ca.cross(spin, axis) * self._rates[index - 1], moved))
            gained, moved = motions[index]
            rigid, gradient = self._rigids[index], gradient_of(spin, gained)
            force = rigid.mass * moved + gradient @ rigid.first_moment
            moment = ca.cross(rigid.first_moment, moved) + turning_moment(
                rigid.inertia, spin, gained, gradient
            )
            wrenches.append((force, moment))
        self._gather(wrenches)
        efforts = (ca.dot(ca.SX(b.axis), w[1]) for b, w in zip(self._bodies[1:], wrenches[1:], strict=True))
        return ca.vertcat(*wrenches[0], *efforts)

    def inertia_factors(self) -> "Factors":
        """Return the factors of H."""
        return factored(self.inertia_matrix())

    def articulated_acceleration(self, force: Expression) -> Expression:
        """Return the same by the articulated-body algorithm, with fewer operations than by H.

        [Featherstone2008], section 7.3, with a base that is free. The inertia of an articulated body is
        [[M, B], [B^T, I]], from linear and angular acceleration to force and moment.
        """
        linear = [rigid.mass * ca.SX.eye(3) for rigid in self._rigids]
        mixed = [-ca.skew(rigid.first_moment) for rigid in self._rigids]
        angular = [rigid.inertia for rigid in self._rigids]
        forces, moments = (list(part) for part in zip(*self._velocity_wrenches(), strict=True))
        steps: list[tuple[Expression, ...]] = [()]
        for body, rate, (velocity, spin) in zip(self._bodies[1:], self._rates, self._twists[1:], strict=True):
            axis = ca.SX(body.axis)
            steps.append((ca.cross(velocity, axis) * rate, ca.cross(spin, axis) * rate))
        for index in range(len(self._bodies) - 1, 0, -1):
            body, place = self._bodies[index], self._bodies[index].place
            axis, across = ca.SX(body.axis), ca.densify(ca.skew(ca.SX(place)))
            pull, turn = mixed[index] @ axis, angular[index] @ axis
            wanted = force[BASE_NV + index - 1] - ca.dot(axis, moments[index])
            inverse = -1.0 / (ca.dot(axis, turn) + body.rotor)
            pull_share, turn_share = pull * inverse, turn * inverse
            own = _symmetric(linear[index] + pull @ pull_share.T)
            both = mixed[index] + pull @ turn_share.T
            spun = _symmetric(angular[index] + turn @ turn_share.T)
            moved, turned = steps[index]
            steps[index] += (pull_share, turn_share, inverse * wanted)
            own_force = forces[index] + own @ moved + both @ turned - pull_share * wanted
            own_moment = moments[index] + both.T @ moved + spun @ turned - turn_share * wanted
            own, both, spun = (self._in_parent(index, part) for part in (own, both, spun))
            own, shifted = _symmetric(own), own @ across
            crossed = across @ both
            spun = _symmetric(spun + crossed + crossed.T - across @ shifted)
            linear[body.parent] += _symmetric(turned_from_mount(body, own))
            mixed[body.parent] += turned_from_mount(body, both - shifted)
            angular[body.parent] += _symmetric(turned_from_mount(body, spun))
            passed_force, passed_moment = self._passed_on(index, own_force, own_moment)
            forces[body.parent] += passed_force
            moments[body.parent] += passed_moment
        whole = ca.blockcat([[linear[0], mixed[0]], [mixed[0].T, angular[0]]])
        rows = [_elements(whole[row, :]) for row in range(BASE_NV)]
        base = substituted(factored(rows), force[:BASE_NV] - ca.vertcat(forces[0], moments[0]))
        along, rates = [(base[:3], base[3:])], []
        for index, body in enumerate(self._bodies[1:], start=1):
            moved, turned, pull_share, turn_share, free = steps[index]
            velocity, spin = self._carried(index, *along[body.parent])
            velocity, spin = velocity + moved, spin + turned
            rate = ca.dot(pull_share, velocity) + ca.dot(turn_share, spin) - free
            rates.append(rate)
            along.append((velocity, spin + ca.SX(body.axis) * rate))
        return ca.vertcat(base, *rates)

    def base_twists(self) -> list[Expression]:
        """Return -H_b^-1 H_bm by columns: the twist (6,) of the base per joint rate at zero momentum."""
        matrix, factors = self.inertia_matrix(), factored(self._base_inertia())
        columns = zip(*(row[BASE_NV:] for row in matrix[:BASE_NV]), strict=True)
        return [substituted(factors, -ca.vertcat(*column)) for column in columns]

    def drift(self) -> Expression:
        """Return H_b^-1 h_b: the twist (6,) of the base that its momentum h_b leaves with joints at rest."""
        return substituted(factored(self._base_inertia()), ca.vertcat(*self.momentum()))

    def _velocity_wrenches(self) -> list[tuple[Expression, Expression]]:
        """Return the wrench that keeps the twist of each body, by Newton and Euler."""
        wrenches = []
        for rigid, (linear, angular) in zip(self._rigids, self._twists, strict=True):
            momentum, spin = rigid.wrench(linear, angular)
            force = ca.cross(angular, momentum)
            wrenches.append((force, ca.cross(angular, spin) + ca.cross(linear, momentum)))
        return wrenches

    def momentum(self) -> tuple[Expression, Expression]:
        """Return linear momentum and angular momentum about the origin of the base, in its axes."""
        momenta = [rigid.wrench(*twist) for rigid, twist in zip(self._rigids, self._twists, strict=True)]
        self._gather(momenta)
        return momenta[0]

    def as_one_body(self) -> Expression:
        """Return mass, first moment (3), inertia xx xy xz yy yz zz about the origin, and momentum P (13,).

        All in axes of the base, with joints locked; P is the linear momentum.
        """
        whole, matrix = self._composites[0], self.inertia_matrix()
        v = [*_elements(ca.vertcat(*self._twists[0])), *self._rates]
        momentum = [_product(matrix[row], v) for row in range(3)]
        inertia = (whole.inertia[i, j] for i in range(3) for j in range(i, 3))
        return ca.vertcat(whole.mass, whole.first_moment, *inertia, *momentum)

    def kinetic_energy(self) -> Expression:
        """Return the kinetic energy in J, with that of the rotors."""
        energy = ca.SX(0.0)
        for rigid, (linear, angular) in zip(self._rigids, self._twists, strict=True):
            momentum, spin = rigid.wrench(linear, angular)
            energy += 0.5 * (ca.dot(linear, momentum) + ca.dot(angular, spin))
        for body, rate in zip(self._bodies[1:], self._rates, strict=True):
            energy += 0.5 * body.rotor * rate**2
        return energy

    def centre_of_mass(self) -> Expression:
        """Return the centre of mass (3,) m in the frame of the base."""
        whole = self._composites[0]
        return whole.first_moment / whole.mass

    def _carried(self, index: int, linear: Expression, angular: Expression) -> tuple[Expression, Expression]:
        """Return a twist or acceleration of the parent in the frame of a body."""
        into = self._rotations[index].T
        for turn in self._bodies[index].turns:
            linear, angular = turn_matrix(*turn).T @ linear, turn_matrix(*turn).T @ angular
        return into @ (linear + ca.cross(angular, ca.SX(self._bodies[index].place))), into @ angular

    def _in_parent(self, index: int, matrix: Expression) -> Expression:
        """Return R M R^T for the rotation R of a body in its parent, but for turns of its mount."""
        body, axis = self._bodies[index], coordinate_axis(self._bodies[index])
        if axis is None:
            return self._rotations[index] @ matrix @ self._rotations[index].T
        found = conjugated(matrix, axis, *self._turns[index - 1])
        return ca.SX(body.rotation) @ found @ ca.SX(body.rotation).T

    def _composed(self) -> list[_Rigid]:
        """Return the composite rigid body of each joint."""
        composites = list(self._rigids)
        for index in range(len(self._bodies) - 1, 0, -1):
            body, own, rotation = self._bodies[index], composites[index], self._rotations[index]
            below, place = composites[body.parent], ca.SX(body.place)
            turned = rotation @ own.first_moment
            half = turned + 0.5 * own.mass * place
            shift = _symmetric(2.0 * ca.dot(place, half) * ca.SX.eye(3) - place @ half.T - half @ place.T)
            moments = [turned, own.mass * place]
            inertias = [self._in_parent(index, own.inertia), shift]
            for turn in reversed(body.turns):
                moments = [turn_matrix(*turn) @ sum(moments)]
                inertias = [_symmetric(conjugated(sum(inertias), *turn))]
            composites[body.parent] = _Rigid(
                below.mass + own.mass,
                sum(moments, below.first_moment),
                _symmetric(sum(inertias, below.inertia)),
            )
        return composites

    def _wrenches(self, joint_acceleration: Sequence[Expression]) -> list[tuple[Expression, Expression]]:
        """Return the wrench at each joint for a base that does not accelerate, by Newton-Euler."""
        zero = ca.SX.zeros(3)
        accelerations, wrenches = [(zero, zero)], []
        for index, body in enumerate(self._bodies):
            linear, angular = self._twists[index]
            if index:
                axis, rate = ca.SX(body.axis), self._rates[index - 1]
                moved, turned = self._carried(index, *accelerations[body.parent])
                moved += ca.cross(linear, axis) * rate
                turned += ca.cross(angular, axis) * rate + axis * joint_acceleration[index - 1]
                accelerations.append((moved, turned))
            rigid = self._rigids[index]
            momentum, spin = rigid.wrench(linear, angular)
            force, moment = rigid.wrench(*accelerations[index])
            force += ca.cross(angular, momentum)
            moment += ca.cross(angular, spin) + ca.cross(linear, momentum)
            wrenches.append((force, moment))
        self._gather(wrenches)
        return wrenches

    def _gather(self, wrenches: list[tuple[Expression, Expression]]) -> None:
        """Add to the wrench of each body those of the bodies that it carries."""
        for index in range(len(self._bodies) - 1, 0, -1):
            parent = self._bodies[index].parent
            force, moment = self._passed_on(index, *wrenches[index])
            wrenches[parent] = (wrenches[parent][0] + force, wrenches[parent][1] + moment)

    def _passed_on(self, index: int, force: Expression, moment: Expression) -> tuple[Expression, Expression]:
        """Return a wrench on a body as one on its parent."""
        body, rotation = self._bodies[index], self._rotations[index]
        turned = rotation @ force
        spun = rotation @ moment + ca.cross(ca.SX(body.place), turned)
        for turn in reversed(body.turns):
            turned, spun = turn_matrix(*turn) @ turned, turn_matrix(*turn) @ spun
        return turned, spun

    def _base_inertia(self) -> list[list[Expression]]:
        """Return H_b (6, 6), that of the robot with locked joints."""
        whole = self._composites[0]
        skew = ca.skew(whole.first_moment)
        matrix = ca.blockcat([[whole.mass * ca.SX.eye(3), -skew], [skew, whole.inertia]])
        return [_elements(matrix[row, :]) for row in range(BASE_NV)]

    def inertia_matrix(self) -> list[list[Expression]]:
        """Return H (6 + n, 6 + n) by composite rigid bodies; 0.0 where neither joint carries the other."""
        size = BASE_NV + len(self._bodies) - 1
        matrix: list[list[Expression]] = [[0.0] * size for _ in range(size)]
        for row, entries in enumerate(self._base_inertia()):
            matrix[row][:BASE_NV] = entries
        for index in range(1, len(self._bodies)):
            joint = BASE_NV + index - 1
            force, moment = self._composites[index].wrench(ca.SX.zeros(3), ca.SX(self._bodies[index].axis))
            at = index
            while at > 0:
                other = BASE_NV + at - 1
                matrix[joint][other] = matrix[other][joint] = ca.dot(ca.SX(self._bodies[at].axis), moment)
                force, moment = self._passed_on(at, force, moment)
                at = self._bodies[at].parent
            for row, entry in enumerate(_elements(ca.vertcat(force, moment))):
                matrix[joint][row] = matrix[row][joint] = entry
            matrix[joint][joint] += self._bodies[index].rotor
        return matrix


@dataclass(frozen=True, eq=False)
class Factors:
    """L and the inverse of D of H = L^T D L; row k of L by the columns where it is not zero."""

    lower: list[dict[int, Expression]]
    inverse: list[Expression]


def factored(matrix: list[list[Expression]]) -> Factors:
    """Return the factors of H, from the tips to the base: what is zero in H stays zero in L.

    [Featherstone2008], section 6.5. ``matrix`` holds 0.0 where H is zero for every configuration.
    """
    size = len(matrix)
    left = [row[:] for row in matrix]
    lower: list[dict[int, Expression]] = [{} for _ in range(size)]
    inverse = [0.0] * size
    for k in range(size - 1, -1, -1):
        inverse[k] = 1.0 / left[k][k]
        linked = [j for j in range(k) if not is_zero(left[k][j])]
        for i in linked:
            lower[k][i] = left[k][i] * inverse[k]
            for j in linked:
                if j <= i:
                    left[i][j] = left[i][j] - lower[k][i] * left[k][j]
    return Factors(lower, inverse)


def substituted(factors: Factors, right: Expression) -> Expression:
    """Return x of H x = r."""
    lower, inverse, x = factors.lower, factors.inverse, _elements(right)
    size = len(x)
    for k in range(size - 1, -1, -1):
        for j, factor in lower[k].items():
            x[j] = x[j] - factor * x[k]
    for k in range(size):
        x[k] = x[k] * inverse[k]
        for j, factor in lower[k].items():
            x[k] = x[k] - factor * x[j]
    return ca.vertcat(*x)


def _product(row: Sequence[Expression], vector: Sequence[Expression]) -> Expression:
    """Return the sum of products, without those that are zero for every configuration."""
    total = ca.SX(0.0)
    for entry, value in zip(row, vector, strict=True):
        if not is_zero(entry):
            total += entry * value
    return total


def is_zero(value: Expression) -> bool:
    """Whether an entry is zero for every configuration."""
    return bool(ca.SX(value).is_zero())


def _symmetric(matrix: Expression) -> Expression:
    """Return a symmetric matrix from its upper half."""
    return ca.blockcat([[matrix[min(i, j), max(i, j)] for j in range(3)] for i in range(3)])


def _elements(vector: Expression) -> list[Expression]:
    """Return the entries of a vector as a list."""
    return [vector[index] for index in range(vector.numel())]
