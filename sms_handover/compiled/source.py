"""The C source of the equations of one robot, written out by CasADi [Andersson2019]."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from sms_handover.compiled.rigid_bodies import RigidBodies
from sms_handover.compiled.step import step_function
from sms_handover.compiled.tree import Body
from sms_handover.model.robot_model import BASE_NV
from sms_handover.plant.integrators import Tableau


def step_source(name: str, bodies: Sequence[Body], tableau: Tableau) -> str:
    """Return C code of a function that maps q, v, u and h to q and v after ``h`` s."""
    angles, v, u = _symbols(bodies)
    found = ca.cse(RigidBodies(bodies, angles, v).acceleration(u))
    acceleration = ca.Function("acceleration", [angles, v, u], [found])
    return _code(step_function(name, acceleration, tableau, len(bodies) - 1))


def joint_efforts_source(name: str, bodies: Sequence[Body]) -> str:
    """Return C code of a function that maps joint angles, v and joint accelerations to joint efforts."""
    angles, v, joint_acceleration = _symbols(bodies)
    found = ca.cse(RigidBodies(bodies, angles, v).joint_efforts(joint_acceleration))
    return _code(ca.Function(name, [angles, v, joint_acceleration], [found]))


def _symbols(bodies: Sequence[Body]) -> tuple[Any, Any, Any]:
    """Return joint angles (n,), velocity (6 + n,) and one more value per joint."""
    joints = len(bodies) - 1
    return ca.SX.sym("angles", joints), ca.SX.sym("v", BASE_NV + joints), ca.SX.sym("x", joints)


def _code(function: Any) -> str:
    """Return the C code of a function."""
    generator = ca.CodeGenerator("dynamics", {"with_header": False})
    generator.add(function)
    text: str = generator.dump()
    return text
