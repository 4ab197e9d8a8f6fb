"""The robot by the method of Lagrange: equations of motion from the kinetic energy of its bodies alone.

No code is shared with Pinocchio or with ``sms_handover.model`` but the description itself. The
generalised coordinates are the paper's: base position, base Euler angles, joint angles. CasADi
differentiates, so nothing is derived by hand.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from sms_handover.model.assembly import ArmDescription, RobotDescription
from sms_handover.model.parts import Inertia, Origin
from sms_handover.types import Array

_N_BASE = 6  # position and Euler angles


@dataclass(frozen=True)
class _Frame:
    """Rotation and origin of a frame in the world, both CasADi expressions."""

    rotation: Any
    origin: Any

    def then(self, rotation: Any, translation: Any) -> "_Frame":
        """Return the frame that lies in this one."""
        return _Frame(self.rotation @ rotation, self.origin + self.rotation @ translation)


@dataclass(frozen=True)
class _Body:
    """A body: mass, inertia about its centre in its own axes, and its central frame."""

    mass: float
    moments: Array
    frame: _Frame


@dataclass(frozen=True, eq=False)
class Motion:
    """Mass matrix (6 + n, 6 + n) and bias forces (6 + n,) for the velocity v = (base twist, joint rates)."""

    inertia: Array
    bias: Array


class Lagrangian:
    """H(q) q'' + c(q, q') = Q by d/dt dT/dq' - dT/dq = Q, with q = (base position, Euler angles, joints).

    Euler angles are roll, pitch, yaw about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll). The results
    are handed out for v = E(q) q', where v has the twist of the base in its own axes: so
    H_v = E^-T H E^-1 and c_v = E^-T c - H_v E' q'. E is regular for |pitch| < pi/2.
    """

    def __init__(self, description: RobotDescription) -> None:
        """Build T(q, q') body by body and differentiate it."""
        joints = [joint.name for arm in description.arms for joint in arm.joints]
        self.n = _N_BASE + len(joints)
        q, rate = ca.SX.sym("q", self.n), ca.SX.sym("rate", self.n)
        base = _Frame(_euler(q[3:6]), q[:3])
        angles = {name: q[_N_BASE + place] for place, name in enumerate(joints)}
        bodies = [_body(description.base.inertia, base)]
        tools = []
        for arm in description.arms:
            links, tool = _chain(arm, base, angles)
            bodies += links
            tools.append(tool)
        energy = _kinetic_energy(bodies, q, rate)
        for arm in description.arms:
            for joint in arm.joints:  # a rotor turns fast and is light: only its spin counts
                energy += 0.5 * joint.rotor_inertia * rate[_N_BASE + joints.index(joint.name)] ** 2
        momentum = ca.gradient(energy, rate)
        inertia = ca.jacobian(momentum, rate)
        bias = ca.jtimes(momentum, q, rate) - ca.gradient(energy, q)
        twist_of_rate = _twist_map(base, q, self.n)
        drift = ca.jtimes(twist_of_rate @ rate, q, rate)  # E' q'
        jacobians = [_tool_jacobian(tool, q) for tool in tools]
        self._dynamics = ca.Function("dynamics", [q, rate], [inertia, bias, twist_of_rate, drift, energy])
        self._tools = ca.Function("tools", [q], jacobians)
        self._arms = [arm.name for arm in description.arms]

    def motion(self, q: Array, v: Array) -> Motion:
        """Return H and c of the motion with velocity ``v`` (6 + n,), the base twist in its own axes."""
        twist_of_rate = np.array(self._dynamics(q, np.zeros(self.n))[2])
        rate = np.linalg.solve(twist_of_rate, v)
        inertia, bias, _, drift, _ = (np.array(value) for value in self._dynamics(q, rate))
        inverse = np.linalg.inv(twist_of_rate)
        turned = inverse.T @ inertia @ inverse
        return Motion(turned, inverse.T @ bias[:, 0] - turned @ drift[:, 0])

    def energy(self, q: Array, v: Array) -> float:
        """Return the kinetic energy in J, the sum over the bodies."""
        twist_of_rate = np.array(self._dynamics(q, np.zeros(self.n))[2])
        return float(self._dynamics(q, np.linalg.solve(twist_of_rate, v))[4])

    def tool_jacobian(self, q: Array, arm: str) -> Array:
        """Return the Jacobian (6, 6 + n) of a tool: twist of its origin in ``world`` axes per v."""
        jacobian = self._tools.call([q])[self._arms.index(arm)]
        twist_of_rate = np.array(self._dynamics(q, np.zeros(self.n))[2])
        return np.asarray(np.linalg.solve(twist_of_rate.T, np.array(jacobian).T).T)


def pinocchio_configuration(q: Array) -> Array:
    """Return base position, base quaternion x y z w and joints for the same place in Euler angles."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(q[3:6] / 2.0), np.cos(q[3:6] / 2.0)
    quaternion = [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
    return np.concatenate([q[:3], quaternion, q[_N_BASE:]])


def _euler(angles: Any) -> Any:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    (roll, pitch, yaw), cos, sin = (angles[0], angles[1], angles[2]), ca.cos, ca.sin
    about_x = ca.vertcat(
        ca.horzcat(1, 0, 0), ca.horzcat(0, cos(roll), -sin(roll)), ca.horzcat(0, sin(roll), cos(roll))
    )
    about_y = ca.vertcat(
        ca.horzcat(cos(pitch), 0, sin(pitch)), ca.horzcat(0, 1, 0), ca.horzcat(-sin(pitch), 0, cos(pitch))
    )
    about_z = ca.vertcat(
        ca.horzcat(cos(yaw), -sin(yaw), 0), ca.horzcat(sin(yaw), cos(yaw), 0), ca.horzcat(0, 0, 1)
    )
    return about_z @ about_y @ about_x


def _about(axis: tuple[float, ...], angle: Any) -> Any:
    """Return the rotation by an angle about a unit axis: n n^T + cos (1 - n n^T) + sin n x."""
    n = np.array(axis)
    outer = np.outer(n, n)
    cross = np.cross(n, np.eye(3)).T  # columns n x e_i
    return ca.DM(outer) + ca.cos(angle) * ca.DM(np.eye(3) - outer) + ca.sin(angle) * ca.DM(cross)


def _place(frame: _Frame, origin: Origin) -> _Frame:
    """Return the frame at an origin given in another."""
    return frame.then(ca.DM(_euler(ca.DM(origin.rpy))), ca.DM(origin.xyz))


def _body(inertia: Inertia, frame: _Frame) -> _Body:
    """Return the body with an inertia given in a frame."""
    xx, xy, xz, yy, yz, zz = inertia.moments
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return _Body(inertia.mass, moments, frame.then(ca.DM.eye(3), ca.DM(inertia.com)))


def _chain(arm: ArmDescription, base: _Frame, angles: dict[str, Any]) -> tuple[list[_Body], _Frame]:
    """Return the bodies of an arm, from the mount outwards, and its tool frame."""
    bodies, frame = [], _place(base, arm.mount)
    for joint, link in zip(arm.joints, arm.links, strict=True):
        frame = _place(frame, joint.origin).then(_about(joint.axis, angles[joint.name]), ca.DM.zeros(3))
        bodies.append(_body(link.inertia, frame))
    flange = _place(frame, arm.flange)
    return [*bodies, _body(arm.gripper.inertia, flange)], _place(flange, arm.gripper.tool)


def _spin(rotation: Any, turning: Any) -> Any:
    """Return the angular velocity in the axes of a frame from R and R': the vector of R^T R'."""
    matrix = rotation.T @ turning
    return (
        ca.vertcat(matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]) / 2
    )


def _kinetic_energy(bodies: list[_Body], q: Any, rate: Any) -> Any:
    """Return T: half m |r'|^2 + half w I w of every body, with r' and R' by the chain rule."""
    total = 0
    for body in bodies:
        velocity = ca.jtimes(body.frame.origin, q, rate)
        turning = ca.reshape(ca.jtimes(ca.vec(body.frame.rotation), q, rate), 3, 3)
        spin = _spin(body.frame.rotation, turning)
        total += 0.5 * body.mass * ca.dot(velocity, velocity)
        total += 0.5 * ca.dot(spin, ca.DM(body.moments) @ spin)
    return total


def _twist_map(base: _Frame, q: Any, n: int) -> Any:
    """Return E (6 + n, 6 + n) with v = E q': R^T for the position, the spin of Euler rates, 1 for joints."""
    turn = [ca.reshape(ca.jacobian(ca.vec(base.rotation), q[3 + axis]), 3, 3) for axis in range(3)]
    spins = ca.horzcat(*(_spin(base.rotation, part) for part in turn))
    return ca.diagcat(base.rotation.T, spins, ca.DM.eye(n - _N_BASE))


def _tool_jacobian(tool: _Frame, q: Any) -> Any:
    """Return the twist in ``world`` axes per q': the derivatives of origin and rotation."""
    rows = []
    for column in range(q.numel()):
        turning = ca.reshape(ca.jacobian(ca.vec(tool.rotation), q[column]), 3, 3)
        rows.append(tool.rotation @ _spin(tool.rotation, turning))
    return ca.vertcat(ca.jacobian(tool.origin, q), ca.horzcat(*rows))
