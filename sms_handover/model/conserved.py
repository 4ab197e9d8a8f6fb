"""Conserved quantities of a free-floating robot, and its kinetic energy."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, frozen


@dataclass(frozen=True, eq=False)
class ConservedQuantities:
    """Momenta, kinetic energy and centre of mass of a body or of several together at one instant.

    ``linear_momentum`` (3,) kg m/s and ``angular_momentum`` (3,) kg m^2/s about the centre of mass
    are in ``world`` axes, ``centre_of_mass`` (3,) m in ``world``, ``kinetic_energy`` in J.
    """

    linear_momentum: Array
    angular_momentum: Array
    centre_of_mass: Array
    kinetic_energy: float


def conserved_quantities(robot: RobotModel, q: Array, v: Array) -> ConservedQuantities:
    """Return the conserved quantities by the centroidal momentum A_G(q) v [Orin2013].

    Kinetic energy is v^T H v / 2, with the rotors in H: Pinocchio 4.1's own sum leaves them out at
    joints whose axis is not x, y or z of their frame. Shapes: ``q`` (7 + n,), ``v`` (6 + n,).
    """
    momentum = pin.computeCentroidalMomentum(robot.pin, robot.data, q, v)
    linear, angular = np.array(momentum.linear), np.array(momentum.angular)
    centre = np.array(robot.data.com[0])
    inertia = pin.crba(robot.pin, robot.data, q, pin.Convention.LOCAL)
    energy = 0.5 * float(v.dot(inertia).dot(v))
    return ConservedQuantities(frozen(linear), frozen(angular), frozen(centre), energy)


def together(
    one: ConservedQuantities, mass: float, other: ConservedQuantities, other_mass: float
) -> ConservedQuantities:
    """Return the conserved quantities of two bodies of these masses in kg.

    With r the place of each centre of mass relative to the common one: P = sum P_i,
    L = sum L_i + r_i x P_i, E = sum E_i.
    """
    total = mass + other_mass
    centre = (mass * one.centre_of_mass + other_mass * other.centre_of_mass) / total
    angular = np.array(one.angular_momentum + other.angular_momentum)
    for part in (one, other):
        angular += np.cross(part.centre_of_mass - centre, part.linear_momentum)
    linear = one.linear_momentum + other.linear_momentum
    energy = one.kinetic_energy + other.kinetic_energy
    return ConservedQuantities(frozen(linear), frozen(angular), frozen(centre), energy)
