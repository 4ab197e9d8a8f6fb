"""C source of the linearisation of a robot's inverse dynamics, by CasADi's algorithmic differentiation."""

from collections.abc import Sequence
from typing import Any

import casadi

from sms_handover.compiled.names import LINEARISATION
from sms_handover.compiled.rigid_bodies import RigidBodies
from sms_handover.compiled.source import own_sine_cosine, with_parameters
from sms_handover.compiled.tree import Body
from sms_handover.model.robot_model import BASE_NV

ca: Any = casadi  # its type hints are incomplete


def linearisation_source(bodies: Sequence[Body]) -> str:
    """Return the C code of one function of joint angles, v (6 + n,), joint accelerations and parameters.

    Results, row by row: the derivative of the momentum of the base (6, n) by angles; the efforts (n,); and
    their derivatives by angles (n, n), by v (n, 6 + n) and by accelerations (n, n).
    """
    joints = len(bodies) - 1
    angles, v = ca.SX.sym("angles", joints), ca.SX.sym("v", BASE_NV + joints)
    wanted = ca.SX.sym("wanted", joints)
    parameters, known = with_parameters(bodies)
    robot = RigidBodies(known, ca.cos(angles), ca.sin(angles), v)
    efforts = robot.joint_efforts(wanted)
    momentum = ca.vertcat(*robot.momentum())
    by = [ca.jacobian(momentum, angles), *(ca.jacobian(efforts, given) for given in (angles, v, wanted))]
    rows = [ca.densify(matrix.T) for matrix in by]  # CasADi has columns where NumPy has rows
    results = ca.cse([rows[0], efforts, *rows[1:]])
    generator = ca.CodeGenerator("linearisation", {"with_header": False})
    generator.add(ca.Function(LINEARISATION, [angles, v, wanted, parameters], results))
    return "\n".join((own_sine_cosine(), generator.dump()))
