"""One step of the plant as a CasADi function: the schemes of ``plant.integrators``."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from sms_handover.model.robot_model import BASE_NQ, BASE_NV
from sms_handover.plant.integrators import Tableau

_SMALL = 1e-3  # [rad^2] below, five terms of a series leave less than rounding


@dataclass(frozen=True, eq=False)
class Acceleration:
    """CasADi functions for v' at the stages of a step.

    ``inertia`` maps cosines, sines, v and the inertial parameters p to what the acceleration depends on
    besides the force: ``kept`` numbers. ``first`` maps these and f to v', ``later`` maps cosines, sines, v, f
    and p to v' with fewer operations.
    """

    inertia: Any
    first: Any
    later: Any

    @property
    def parameters(self) -> int:
        """How many parameters there are."""
        return int(self.inertia.size1_in(3))

    @property
    def kept(self) -> int:
        """How many numbers a tick keeps."""
        return int(self.inertia.size1_out(0))


def step_function(name: str, by: Acceleration, tableau: Tableau, joints: int, *, goes_on: bool) -> Any:
    """Return (q, v, f, p, h) -> (q, v) after a step of ``h`` s under a force f (6 + n,).

    A step that ``goes_on`` is given the kept numbers of q and v too, as last argument. The sums are those of
    :class:`~sms_handover.plant.integrators.LieGroupIntegrator`. As accelerations do not depend on the base
    pose, the base moves at the end of the step only.
    """
    q, v = ca.MX.sym("q", BASE_NQ + joints), ca.MX.sym("v", BASE_NV + joints)
    force, h = ca.MX.sym("f", BASE_NV + joints), ca.MX.sym("h")
    parameters = ca.MX.sym("p", by.parameters)
    velocities: list[Any] = []
    accelerations: list[Any] = []
    kept = ca.MX.sym("kept", by.kept)
    for row in tableau.a:
        at = q[BASE_NQ:] + h * _sum(row, [velocity[BASE_NV:] for velocity in velocities])
        velocity = v + h * _sum(row, accelerations)
        turn = (ca.cos(at), ca.sin(at))
        if accelerations:
            accelerations.append(by.later(*turn, velocity, force, parameters))
        else:
            of_state = kept if goes_on else by.inertia(*turn, velocity, parameters)
            accelerations.append(by.first(of_state, force))
        velocities.append(velocity)
    given = [q, v, force, parameters, h, *([kept] if goes_on else [])]
    return ca.Function(name, given, _end(q, v, h, tableau, velocities, accelerations))


def _end(q: Any, v: Any, h: Any, tableau: Tableau, velocities: list[Any], accelerations: list[Any]) -> Any:
    """Return q and v at the end of a step, from those of its stages."""
    pose, angles = q[:BASE_NQ], q[BASE_NQ:]
    move = _move()
    for row in tableau.b:
        motion = h * _sum(row, velocities)
        pose, angles = move(pose, motion[:BASE_NV]), angles + motion[BASE_NV:]
    total = [sum(weights) for weights in zip(*tableau.b, strict=True)]
    return [ca.vertcat(pose, angles), v + h * _sum(total, accelerations)]


def held_step_function(name: str, by: Acceleration, tableau: Tableau, joints: int) -> Any:
    """Return (q, v, f, p, h, v') -> (q, v) after a step with the acceleration of its first stage given.

    The wrench on the base of the force f (6 + n,) is given in axes of the base at the start, and held in
    those of the world: at a stage it is exp(-theta) f by a series in the turn theta of the base, to order 4.
    """
    q, v = ca.MX.sym("q", BASE_NQ + joints), ca.MX.sym("v", BASE_NV + joints)
    force, h = ca.MX.sym("f", BASE_NV + joints), ca.MX.sym("h")
    parameters = ca.MX.sym("p", by.parameters)
    first = ca.MX.sym("a", BASE_NV + joints)
    turned_back = _turned_back()
    velocities, accelerations, wrenches = [v], [first], [force[:BASE_NV]]
    for row, origin in zip(tableau.a[1:], tableau.origins[1:], strict=True):
        at = q[BASE_NQ:] + h * _sum(row, [velocity[BASE_NV:] for velocity in velocities])
        velocity = v + h * _sum(row, accelerations)
        before = (*tableau.a[origin], *[0.0] * len(row))
        weights = [own - theirs for own, theirs in zip(row, before, strict=False)]
        turn = h * _sum(weights, [velocity[3:BASE_NV] for velocity in velocities])
        wrenches.append(turned_back(wrenches[origin], turn))
        here = ca.vertcat(wrenches[-1], force[BASE_NV:])
        accelerations.append(by.later(ca.cos(at), ca.sin(at), velocity, here, parameters))
        velocities.append(velocity)
    results = _end(q, v, h, tableau, velocities, accelerations)
    return ca.Function(name, [q, v, force, parameters, h, first], results)


def _turned_back() -> Any:
    """Return (wrench, turn) -> the wrench (6,) in axes that have turned: exp(-theta) by its series."""
    wrench, turn = ca.SX.sym("wrench", BASE_NV), ca.SX.sym("turn", 3)
    found = []
    for part in (wrench[:3], wrench[3:]):
        term = total = part
        for order in range(1, 5):
            term = ca.cross(term, turn) * (1.0 / order)
            total = total + term
        found.append(total)
    return ca.Function("turned_back", [wrench, turn], [ca.cse(ca.vertcat(*found))])


def _sum(weights: Any, values: list[Any]) -> Any:
    """Return the weighted sum, without zero weights."""
    total = 0.0
    for weight, value in zip(weights, values, strict=False):
        if weight:
            total = total + weight * value
    return total


def _move() -> Any:
    """Return (pose, motion) -> pose (+) motion, the exponential map of SE(3).

    A pose is (7,) position and quaternion x y z w, a motion (6,) is in axes of the pose. The new
    quaternion is brought back to unit length to first order, as Pinocchio does.
    """
    pose, motion = ca.SX.sym("pose", BASE_NQ), ca.SX.sym("motion", BASE_NV)
    position, vector, scalar = pose[:3], pose[3:6], pose[6]
    linear, angular = motion[:3], motion[3:]
    square = ca.dot(angular, angular)
    half, first, second = _coefficients(square)
    turned = ca.cross(angular, linear)
    shift = linear + first * turned + second * ca.cross(angular, turned)
    across = ca.cross(vector, shift)
    moved = position + shift + 2.0 * (scalar * across + ca.cross(vector, across))
    turn, along = half * angular, ca.cos(0.5 * ca.sqrt(square))
    imaginary = scalar * turn + along * vector + ca.cross(vector, turn)
    quaternion = ca.vertcat(imaginary, scalar * along - ca.dot(vector, turn))
    quaternion *= 0.5 * (3.0 - ca.dot(quaternion, quaternion))
    return ca.Function("move", [pose, motion], [ca.vertcat(moved, quaternion)])


def _coefficients(square: Any) -> tuple[Any, Any, Any]:
    """Return sin(a/2)/a, (1 - cos a)/a^2 and (a - sin a)/a^3 for a^2."""
    small = square < _SMALL
    safe = ca.if_else(small, 1.0, square)
    angle = ca.sqrt(safe)
    sine = ca.sin(0.5 * angle) / angle
    return (
        ca.if_else(small, _series(square, (1 / 2, -1 / 48, 1 / 3840, -1 / 645120, 1 / 185794560)), sine),
        ca.if_else(small, _series(square, (1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800)), 2.0 * sine**2),
        ca.if_else(
            small,
            _series(square, (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800)),
            (angle - ca.sin(angle)) / (angle * safe),
        ),
    )


def _series(x: Any, coefficients: tuple[float, ...]) -> Any:
    """Return c_0 + c_1 x + c_2 x^2 ... by Horner's rule."""
    value = 0.0
    for coefficient in reversed(coefficients):
        value = coefficient + x * value
    return value
