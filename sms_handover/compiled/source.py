"""The C source of the equations of one robot, written out by CasADi [Andersson2019]."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from sms_handover.compiled.rigid_bodies import RigidBodies
from sms_handover.compiled.step import step_function
from sms_handover.compiled.tree import Body
from sms_handover.model.robot_model import BASE_NQ, BASE_NV
from sms_handover.plant.integrators import Tableau


def step_source(name: str, bodies: Sequence[Body], tableau: Tableau) -> str:
    """Return C code of a function that maps q, v, u and h to q and v after ``h`` s."""
    angles, v, u = _symbols(bodies)
    found = ca.cse(RigidBodies(bodies, angles, v).acceleration(u))
    acceleration = ca.Function("acceleration", [angles, v, u], [found])
    return _code(step_function(name, acceleration, tableau, len(bodies) - 1))


def computed_torque_source(name: str, bodies: Sequence[Body]) -> str:
    """Return C code of a function that maps q, v, the desired motion (3, n) and two gains to efforts."""
    angles, v, _ = _symbols(bodies)
    base, feedback = ca.SX.sym("base", BASE_NQ), ca.SX.sym("feedback", 2)
    desired = ca.SX.sym("desired", len(bodies) - 1, 3)  # CasADi has columns where NumPy has rows
    error, error_rate = angles - desired[:, 0], v[BASE_NV:] - desired[:, 1]
    wanted = desired[:, 2] - feedback[0] * error - feedback[1] * error_rate
    found = ca.cse(RigidBodies(bodies, angles, v).joint_efforts(wanted))
    return _code(ca.Function(name, [ca.vertcat(base, angles), v, desired, feedback], [found]))


def _symbols(bodies: Sequence[Body]) -> tuple[Any, Any, Any]:
    """Return joint angles (n,), velocity (6 + n,) and joint efforts (n,)."""
    joints = len(bodies) - 1
    return ca.SX.sym("angles", joints), ca.SX.sym("v", BASE_NV + joints), ca.SX.sym("u", joints)


def _code(function: Any) -> str:
    """Return the C code of a function."""
    generator = ca.CodeGenerator("dynamics", {"with_header": False})
    generator.add(function)
    text: str = generator.dump()
    return text
