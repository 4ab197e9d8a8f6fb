"""Kinematics functions: tools, their Jacobians and the momenta of a robot as CasADi functions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi

from sms_handover.compiled.names import (
    CARRIED,
    CONSERVED,
    GENERALIZED_JACOBIAN,
    MOTION,
    TOOL_JACOBIANS,
    TOOLS,
)
from sms_handover.compiled.rigid_bodies import RigidBodies
from sms_handover.compiled.tree import Body, Tool
from sms_handover.compiled.turns import turn_matrix, turned_about_axis
from sms_handover.model.robot_model import BASE_NQ, BASE_NV

ca: Any = casadi  # its type hints are incomplete
Expression = Any  # casadi.SX


@dataclass(frozen=True, eq=False)
class _Placed:
    """Rotation and origin of each body and of each tool in the base, and of the base in ``world``."""

    bodies: list[tuple[Expression, Expression]]
    tools: list[tuple[Expression, Expression]]
    base: tuple[Expression, Expression]


def kinematics_functions(
    tools: Sequence[Tool], angles: Expression, v: Expression, parameters: Expression, bodies: Sequence[Body]
) -> list[Any]:
    """Return the functions of a robot whose ``bodies`` have ``parameters`` in place of numbers.

    Of q (7 + n,) and parameters: the poses of the tools, each the rows of its rotation and its origin (12),
    in ``world``; the same with their Jacobians for a base at rest, per joint of an arm after the other: the
    velocity of the origin of the tool in ``world`` axes (3), its angular velocity in axes of the tool (3).
    With v too: the poses, and the twists (6) of the origins in ``world`` axes; and in ``world`` the
    linear momentum (3), angular momentum about the centre of mass (3), centre of mass (3), kinetic energy.
    Of q and parameters: the generalised Jacobian (6 arms, n), row by row. Of q, v and parameters: the twists
    that the tools have by the momentum alone, with joints at rest.
    """
    base = ca.SX.sym("base", BASE_NQ)
    q = ca.vertcat(base, angles)
    placed = _placed(tools, bodies, base, angles)
    robot = RigidBodies(bodies, ca.cos(angles), ca.sin(angles), v)
    poses = _poses(placed)
    columns = _columns(tools, bodies, placed)
    linear, angular = (ca.vertcat(*(column[part] for column in columns)) for part in range(2))
    twists = _twists(tools, placed, columns, v)
    functions = {
        TOOLS: ([q, parameters], [poses]),
        TOOL_JACOBIANS: ([q, parameters], [poses, linear, angular]),
        MOTION: ([q, v, parameters], [poses, twists]),
        CONSERVED: ([q, v, parameters], [_conserved(placed, robot)]),
        GENERALIZED_JACOBIAN: ([q, parameters], [_generalized(tools, placed, columns, robot)]),
        CARRIED: ([q, v, parameters], [_carried(placed, robot)]),
    }
    return [ca.Function(name, given, ca.cse(found)) for name, (given, found) in functions.items()]


def _placed(tools: Sequence[Tool], bodies: Sequence[Body], base: Expression, angles: Expression) -> _Placed:
    """Return where everything is."""
    placed = [(ca.SX.eye(3), ca.SX.zeros(3))]
    for index, body in enumerate(bodies[1:]):
        rotation, origin = placed[body.parent]
        for turn in body.turns:
            rotation = rotation @ turn_matrix(*turn)
        cosine, sine = ca.cos(angles[index]), ca.sin(angles[index])
        own = ca.SX(body.rotation) @ turned_about_axis(body, cosine, sine)
        placed.append((rotation @ own, origin + rotation @ ca.SX(body.place)))
    ends = []
    for tool in tools:
        rotation, origin = placed[tool.body]
        ends.append((rotation @ ca.SX(tool.rotation), origin + rotation @ ca.SX(tool.place)))
    return _Placed(placed, ends, (_rotation(base[3:]), base[:3]))


def _rotation(quaternion: Expression) -> Expression:
    """Return the rotation of a quaternion x y z w of unit length."""
    x, y, z, w = (quaternion[index] for index in range(4))
    return ca.blockcat(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _poses(placed: _Placed) -> Expression:
    """Return rotation, row by row, and origin of every tool in ``world``."""
    turn, way = placed.base
    rows = [ca.vertcat(ca.reshape((turn @ own).T, 9, 1), way + turn @ origin) for own, origin in placed.tools]
    return ca.vertcat(*rows)


def _columns(
    tools: Sequence[Tool], bodies: Sequence[Body], placed: _Placed
) -> list[tuple[Expression, Expression]]:
    """Return, per joint of an arm after the other, what its rate gives its tool."""
    columns = []
    for tool, (rotation, origin) in zip(tools, placed.tools, strict=True):
        for joint in range(tool.first_joint, tool.first_joint + tool.joints):
            turn, place = placed.bodies[joint + 1]
            axis = turn @ ca.SX(bodies[joint + 1].axis)
            columns.append((placed.base[0] @ ca.cross(axis, origin - place), rotation.T @ axis))
    return columns


def _twists(
    tools: Sequence[Tool], placed: _Placed, columns: list[tuple[Expression, Expression]], v: Expression
) -> Expression:
    """Return the twists of the origins of the tools in ``world`` axes."""
    turn, remaining = placed.base[0], iter(columns)
    twists = []
    for tool, (rotation, origin) in zip(tools, placed.tools, strict=True):
        linear = turn @ (v[:3] + ca.cross(v[3:BASE_NV], origin))
        angular = v[3:BASE_NV]
        for joint in range(tool.first_joint, tool.first_joint + tool.joints):
            moved, turned = next(remaining)
            linear += moved * v[BASE_NV + joint]
            angular += rotation @ turned * v[BASE_NV + joint]
        twists.append(ca.vertcat(linear, turn @ angular))
    return ca.vertcat(*twists)


def _carried(placed: _Placed, robot: RigidBodies) -> Expression:
    """Return the twists of the origins of the tools in ``world`` axes as parts of a base that drifts."""
    turn, drift = placed.base[0], robot.drift()
    twists = [
        ca.vertcat(turn @ (drift[:3] + ca.cross(drift[3:], origin)), turn @ drift[3:])
        for _, origin in placed.tools
    ]
    return ca.vertcat(*twists)


def _generalized(
    tools: Sequence[Tool],
    placed: _Placed,
    columns: list[tuple[Expression, Expression]],
    robot: RigidBodies,
) -> Expression:
    """Return the transpose of the generalised Jacobian, whose columns CasADi writes one after the other."""
    turn, remaining = placed.base[0], iter(columns)
    rows = []
    for tool, (rotation, origin) in zip(tools, placed.tools, strict=True):
        twists = [(base[:3] + ca.cross(base[3:], origin), base[3:]) for base in robot.base_twists()]
        parts = [ca.vertcat(turn @ linear, turn @ angular) for linear, angular in twists]
        for joint in range(tool.first_joint, tool.first_joint + tool.joints):
            moved, turned = next(remaining)
            parts[joint] += ca.vertcat(moved, turn @ (rotation @ turned))
        rows.append(ca.horzcat(*parts))
    return ca.densify(ca.vertcat(*rows).T)


def _conserved(placed: _Placed, robot: RigidBodies) -> Expression:
    """Return momenta, centre of mass and energy in ``world``."""
    turn, way = placed.base
    momentum, spin = robot.momentum()
    centre = robot.centre_of_mass()
    about_centre = spin - ca.cross(centre, momentum)
    return ca.vertcat(turn @ momentum, turn @ about_centre, way + turn @ centre, robot.kinetic_energy())
