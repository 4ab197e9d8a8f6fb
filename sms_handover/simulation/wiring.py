"""Wiring: makes plant and controller of a scenario, for nodes and for one process alike."""

import numpy as np

from sms_handover.compiled.dynamics import CompiledComputedTorque, CompiledStepper
from sms_handover.control.computed_torque import ComputedTorque, TrackingEfforts
from sms_handover.control.controller import Gains, JointController
from sms_handover.control.nmpc import NmpcGains
from sms_handover.control.parameters import LAWS, ControllerParameters, gains_of
from sms_handover.errors import UnknownNameError
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant, InitialState
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.plant.parameters import PlantParameters
from sms_handover.plant.stepper import PinocchioStepper, Stepper
from sms_handover.simulation.parameters import COMPILED, CommonParameters
from sms_handover.trajectory.schedule import Schedule
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds, seconds_to_ns


def initial_joints(robot: RobotModel, schedule: Schedule) -> Array:
    """Return the initial joint angles (n,) in the order of the robot's joints."""
    joints = np.zeros(robot.n_joints)
    for arm, values in schedule.initial_joints.items():
        joints[robot.arm_joints[arm]] = values
    return joints


def make_plant(
    robot: RobotModel, schedule: Schedule, common: CommonParameters, parameters: PlantParameters
) -> FreeFloatingPlant:
    """Return the plant at the start of the schedule; raises ConfigurationError."""
    initial = InitialState(
        schedule.base_in_world,
        initial_joints(robot, schedule),
        schedule.deputy.deputy_in_world,
        dict(schedule.deputy.grasp_frames),
    )
    tableau = TABLEAUS[parameters.integrator]
    stepper = make_stepper(robot, common.dynamics, tableau, ns_to_seconds(common.tick_ns))
    return FreeFloatingPlant(robot, parameters, initial, common.tick_ns, stepper)


def make_stepper(robot: RobotModel, dynamics: str, tableau: Tableau, h: float) -> Stepper:
    """Return the stepper for steps of ``h`` s; raises ConfigurationError."""
    kind = CompiledStepper if dynamics == COMPILED else PinocchioStepper
    return kind(robot, tableau, h)


def make_efforts(robot: RobotModel, dynamics: str) -> TrackingEfforts:
    """Return the computed torque of a robot; raises ConfigurationError."""
    return CompiledComputedTorque(robot) if dynamics == COMPILED else ComputedTorque(robot)


def gains_by_phase(schedule: Schedule, parameters: ControllerParameters) -> tuple[Gains, ...]:
    """Return the gains of the law for every phase; a phase overrides only the gains it names."""
    found = []
    for phase in schedule.phases:
        where = f"gains of phase {phase.name!r}"
        for law in phase.gains:
            if law not in LAWS:
                raise UnknownNameError("control law", law, LAWS, where)
        found.append(gains_of(parameters, phase.gains.get(parameters.law, {}), where))
    return tuple(found)


def make_controller(
    robot: RobotModel, schedule: Schedule, common: CommonParameters, parameters: ControllerParameters
) -> JointController:
    """Return the controller, with gains stable at the start; raises ConfigurationError."""
    start = robot.configuration(schedule.base_in_world, initial_joints(robot, schedule))
    longest_ns = longest_reference_ns(common, parameters)
    gains = gains_by_phase(schedule, parameters)
    efforts = make_efforts(robot, common.dynamics) if isinstance(gains[0], NmpcGains) else None
    return JointController(robot, gains, common.tick_ns, start, longest_ns, efforts)


def longest_reference_ns(common: CommonParameters, parameters: ControllerParameters) -> int:
    """Return the age in ns up to which the controller extrapolates a reference."""
    return common.reference_ns + seconds_to_ns(parameters.reference_hold)
