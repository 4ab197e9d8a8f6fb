"""Rigid bodies: the dynamics of a free-floating tree as CasADi expressions [Featherstone2008].

Vectors are in the frame of their body. A wrench is a force and a moment about the origin of the frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from sms_handover.compiled.tree import Body
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
    """The equations of motion H(q) v' + c(q, v) = (0, u) at angles (n,) and a velocity v (6 + n,).

    In free space H, c and hence v' do not depend on the base pose.
    """

    def __init__(self, bodies: Sequence[Body], angles: Expression, v: Expression) -> None:
        self._bodies = bodies
        self._rigids = [_Rigid(body.mass, ca.SX(body.first_moment), ca.SX(body.inertia)) for body in bodies]
        self._rates = [v[BASE_NV + joint] for joint in range(len(bodies) - 1)]
        self._rotations = [ca.SX.eye(3)]  # of each body in its parent
        self._twists = [(v[:3], v[3:BASE_NV])]
        for body, angle, rate in zip(bodies[1:], _elements(angles), self._rates, strict=True):
            self._rotations.append(ca.SX(body.rotation) @ turned_about_axis(body, angle))
            linear, angular = self._carried(len(self._twists), *self._twists[body.parent])
            self._twists.append((linear, angular + ca.SX(body.axis) * rate))
        self._composites = self._composed()

    def joint_efforts(self, joint_acceleration: Expression) -> Expression:
        """Return u (n,) N m that brings about joint accelerations (n,), as ``reduced_inverse_dynamics``.

        A base at rest would need the wrench f_b; without it the base accelerates by a_b = -H_b^-1 f_b, and
        each composite body follows.
        """
        wrenches = self._wrenches(_elements(joint_acceleration))
        yielding = _solved(self._base_inertia(), -ca.vertcat(*wrenches[0]))
        along = [(yielding[:3], yielding[3:])]
        efforts = []
        for index, body in enumerate(self._bodies[1:], start=1):
            along.append(self._carried(index, *along[body.parent]))
            _, moment = self._composites[index].wrench(*along[index])
            rotor = body.rotor * joint_acceleration[index - 1]
            efforts.append(ca.dot(ca.SX(body.axis), wrenches[index][1] + moment) + rotor)
        return ca.vertcat(*efforts)

    def acceleration(self, force: Expression) -> Expression:
        """Return v' (6 + n,) under a wrench on the base and joint efforts (6 + n,), from H v' = f - c."""
        wrenches = self._wrenches([0.0] * len(self._rates))
        bias = [
            ca.dot(ca.SX(body.axis), moment)
            for body, (_, moment) in zip(self._bodies[1:], wrenches[1:], strict=True)
        ]
        return _solved(self._inertia_matrix(), force - ca.vertcat(*wrenches[0], *bias))

    def momentum(self) -> tuple[Expression, Expression]:
        """Return linear momentum and angular momentum about the origin of the base, in its axes."""
        momenta = [rigid.wrench(*twist) for rigid, twist in zip(self._rigids, self._twists, strict=True)]
        for index in range(len(self._bodies) - 1, 0, -1):
            parent, passed = self._bodies[index].parent, self._passed_on(index, *momenta[index])
            momenta[parent] = (momenta[parent][0] + passed[0], momenta[parent][1] + passed[1])
        return momenta[0]

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
        return into @ (linear + ca.cross(angular, ca.SX(self._bodies[index].place))), into @ angular

    def _composed(self) -> list[_Rigid]:
        """Return the composite rigid body of each joint."""
        composites = list(self._rigids)
        for index in range(len(self._bodies) - 1, 0, -1):
            body, own, rotation = self._bodies[index], composites[index], self._rotations[index]
            below, place = composites[body.parent], ca.SX(body.place)
            turned = rotation @ own.first_moment
            half = turned + 0.5 * own.mass * place
            shift = _symmetric(2.0 * ca.dot(place, half) * ca.SX.eye(3) - place @ half.T - half @ place.T)
            composites[body.parent] = _Rigid(
                below.mass + own.mass,
                below.first_moment + turned + own.mass * place,
                _symmetric(below.inertia + rotation @ own.inertia @ rotation.T + shift),
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
        for index in range(len(self._bodies) - 1, 0, -1):
            parent = self._bodies[index].parent
            force, moment = self._passed_on(index, *wrenches[index])
            wrenches[parent] = (wrenches[parent][0] + force, wrenches[parent][1] + moment)
        return wrenches

    def _passed_on(self, index: int, force: Expression, moment: Expression) -> tuple[Expression, Expression]:
        """Return a wrench on a body as one on its parent."""
        rotation = self._rotations[index]
        turned = rotation @ force
        return turned, rotation @ moment + ca.cross(ca.SX(self._bodies[index].place), turned)

    def _base_inertia(self) -> list[list[Expression]]:
        """Return H_b (6, 6), that of the robot with locked joints."""
        whole = self._composites[0]
        skew = ca.skew(whole.first_moment)
        matrix = ca.blockcat([[whole.mass * ca.SX.eye(3), -skew], [skew, whole.inertia]])
        return [_elements(matrix[row, :]) for row in range(BASE_NV)]

    def _inertia_matrix(self) -> list[list[Expression]]:
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


def _solved(matrix: list[list[Expression]], right: Expression) -> Expression:
    """Return x of H x = r by H = L^T D L, from the tips to the base: what is zero in H stays zero in L.

    [Featherstone2008], section 6.5. ``matrix`` holds 0.0 where H is zero for every configuration.
    """
    size = len(matrix)
    left, x = [row[:] for row in matrix], _elements(right)
    lower: list[dict[int, Expression]] = [{} for _ in range(size)]
    inverse = [0.0] * size
    for k in range(size - 1, -1, -1):
        inverse[k] = 1.0 / left[k][k]
        linked = [j for j in range(k) if not _is_zero(left[k][j])]
        for i in linked:
            lower[k][i] = left[k][i] * inverse[k]
            for j in linked:
                if j <= i:
                    left[i][j] = left[i][j] - lower[k][i] * left[k][j]
    for k in range(size - 1, -1, -1):
        for j, factor in lower[k].items():
            x[j] = x[j] - factor * x[k]
    for k in range(size):
        x[k] = x[k] * inverse[k]
        for j, factor in lower[k].items():
            x[k] = x[k] - factor * x[j]
    return ca.vertcat(*x)


def _is_zero(value: Expression) -> bool:
    """Whether an entry is zero for every configuration."""
    return bool(ca.SX(value).is_zero())


def turned_about_axis(body: Body, angle: Expression) -> Expression:
    """Return the rotation about the axis of a joint by Rodrigues' formula."""
    cross, along = np.array(ca.skew(body.axis)), np.outer(body.axis, body.axis)
    return ca.cos(angle) * ca.SX(np.eye(3) - along) + ca.sin(angle) * ca.SX(cross) + ca.SX(along)


def _symmetric(matrix: Expression) -> Expression:
    """Return a symmetric matrix from its upper half."""
    return ca.blockcat([[matrix[min(i, j), max(i, j)] for j in range(3)] for i in range(3)])


def _elements(vector: Expression) -> list[Expression]:
    """Return the entries of a vector as a list."""
    return [vector[index] for index in range(vector.numel())]
