"""Dynamics of the plant: what steps a robot and works out its kinematics, made anew for every payload."""

from collections.abc import Callable
from dataclasses import dataclass

from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.conditioned_stepper import Resistance, ResistedStepper
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.kinematics import PinocchioKinematics, PlantKinematics
from sms_handover.plant.stepper import PinocchioStepper, Stepper


@dataclass(frozen=True, eq=False)
class PlantDynamics:
    """Stepper and kinematics of one robot.

    ``resisted`` makes steps under friction and wrenches where it can, and None where another stepper is to.
    """

    stepper: Stepper
    kinematics: PlantKinematics
    resisted: Callable[[Resistance], ResistedStepper | None] | None = None


MakeDynamics = Callable[[RobotModel], PlantDynamics]


def pinocchio_dynamics(tableau: Tableau, h: float) -> MakeDynamics:
    """Return what makes dynamics by Pinocchio, with steps of ``h`` s."""
    return lambda robot: PlantDynamics(PinocchioStepper(robot, tableau, h), PinocchioKinematics(robot))
