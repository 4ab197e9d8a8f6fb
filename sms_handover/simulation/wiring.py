"""Wiring: makes plant and controller of a scenario, for nodes and for one process alike."""

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from sms_handover.clearance.distances import ClearanceModel
from sms_handover.clearance.monitor import ClearanceMonitor
from sms_handover.compiled.dynamics import CompiledComputedTorque, CompiledStepper
from sms_handover.compiled.effects import CompiledResistedStepper
from sms_handover.compiled.inverse_kinematics import CompiledIk
from sms_handover.compiled.kinematics import CompiledKinematics
from sms_handover.compiled.linearisation import CompiledDerivatives
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.compiled.tool_motion import CompiledToolMotion
from sms_handover.compiled.wrench_table import WrenchTable
from sms_handover.conditions.conditions import IDEAL, Conditions
from sms_handover.conditions.sensors.suite import SensorSuite
from sms_handover.control.compensation import CompensatedTorque, Compensation
from sms_handover.control.computed_torque import ComputedTorque, TrackingEfforts
from sms_handover.control.friction_feed_forward import FrictionFeedForward
from sms_handover.control.integral_action import IntegralAction
from sms_handover.control.law import Law, LawSetup, Need
from sms_handover.control.parameters import ControllerParameters, gains_of
from sms_handover.control.protocol import CheckedController, Controller
from sms_handover.control.registry import SHIPPED, law_named, require_law
from sms_handover.control.stability import check_stability
from sms_handover.errors import ConfigurationError, ScheduleError
from sms_handover.ik.levenberg_marquardt import FindJoints, find_joints
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.conditioned_stepper import Resistance, ResistedStepper
from sms_handover.plant.dynamics import MakeDynamics, PlantDynamics, pinocchio_dynamics
from sms_handover.plant.effects import PlantEffects
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.plant.parameters import PlantParameters
from sms_handover.plant.plant_state import InitialState
from sms_handover.plant.sensed_plant import SensedPlant
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.parameters import COMPILED, MEASURED, TRUE, CommonParameters
from sms_handover.simulation.period_runner import PeriodRunner, PythonRunner
from sms_handover.simulation.solver_process import SolverProcess
from sms_handover.trajectory.generator import TrajectoryGenerator
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.trajectory.preview import TargetPreview
from sms_handover.trajectory.schedule import Schedule
from sms_handover.trajectory.tool_motion import PinocchioToolMotion
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds, seconds_to_ns

_MOST_TURN = 0.1  # [rad] of a free deputy in a tick, where the integration still keeps its energy
_LOG = logging.getLogger(__name__)


def initial_joints(robot: RobotModel, schedule: Schedule) -> Array:
    """Return the initial joint angles (n,) in the order of the robot's joints."""
    joints = np.zeros(robot.n_joints)
    for arm, values in schedule.initial_joints.items():
        joints[robot.arm_joints[arm]] = values
    return joints


def make_plant(
    robot: RobotModel,
    schedule: Schedule,
    common: CommonParameters,
    parameters: PlantParameters,
    conditions: Conditions = IDEAL,
) -> FreeFloatingPlant:
    """Return the plant at the start of the schedule; raises ConfigurationError."""
    initial = InitialState(
        schedule.base_in_world,
        initial_joints(robot, schedule),
        schedule.deputy.deputy_in_world,
        dict(schedule.deputy.grasp_frames),
        schedule.deputy.twist_in_world,
        schedule.deputy.inertia,
    )
    tableau, h = TABLEAUS[parameters.integrator], ns_to_seconds(common.tick_ns)
    _check_deputy_twist(schedule, h)
    joints, tick_ns, seed = robot.n_joints, common.tick_ns, common.seed
    effects = PlantEffects(conditions, joints, tick_ns, seed) if conditions.acts else None
    dynamics = make_dynamics(common.dynamics, tableau, h)
    sensors = make_sensors(conditions, joints, common)
    if sensors:
        return SensedPlant(robot, parameters, initial, tick_ns, sensors, dynamics, effects)
    if common.uses_measurements:
        raise ConfigurationError(
            f"source is {MEASURED!r}, must be {TRUE!r} where there are no sensors: set conditions.sensors"
        )
    return FreeFloatingPlant(robot, parameters, initial, tick_ns, dynamics, effects)


def make_sensors(conditions: Conditions, joints: int, common: CommonParameters) -> SensorSuite | None:
    """Return the sensors for so many joints, None if there are none; raises ConfigurationError."""
    if not conditions.sensors:
        return None
    return SensorSuite(conditions.sensors, joints, common.tick_ns, common.seed)


def make_dynamics(dynamics: str, tableau: Tableau, h: float) -> MakeDynamics:
    """Return what makes the dynamics of the plant, by Pinocchio or compiled."""
    if dynamics != COMPILED:
        return pinocchio_dynamics(tableau, h)
    by_pinocchio = pinocchio_dynamics(tableau, h)

    def make(robot: RobotModel) -> PlantDynamics:
        if robot.springs:  # C knows of no springs
            return by_pinocchio(robot)
        resisted = partial(_resisted_stepper, robot, tableau, seconds_to_ns(h))
        return PlantDynamics(CompiledStepper(robot, tableau, h), CompiledKinematics(robot), resisted)

    return make


def _resisted_stepper(
    robot: RobotModel, tableau: Tableau, tick_ns: int, resistance: Resistance
) -> ResistedStepper | None:
    """Return compiled steps under friction and wrenches, None where C does not have one of these."""
    if not WrenchTable.knows(resistance.wrenches):
        say_once("steps under wrenches are Pinocchio's: C does not have one of their kinds")
        return None
    return CompiledResistedStepper(robot, resistance, tableau, tick_ns)


def make_generator(
    robot: RobotModel, schedule: Schedule, common: CommonParameters, parameters: TrajectoryParameters
) -> TrajectoryGenerator:
    """Return the generator of the trajectory; raises ConfigurationError."""
    motion = CompiledToolMotion if common.dynamics == COMPILED else PinocchioToolMotion
    aborts, fails = common.aborts_on_collision, common.fails_on_touch
    return TrajectoryGenerator(
        robot, schedule, parameters, motion, abort_on_collision=aborts, fail_on_touch=fails
    )


def make_ik(robot: RobotModel, common: CommonParameters, parameters: IkParameters) -> FindJoints:
    """Return the solver of inverse kinematics; raises ConfigurationError."""
    if common.dynamics == COMPILED:
        return CompiledIk(robot, parameters)
    return lambda request: find_joints(robot, request, parameters)


def make_clearance(robot: RobotModel, schedule: Schedule) -> ClearanceModel:
    """Return the distances of the bodies of robot and deputy; raises RobotDescriptionError."""
    return ClearanceModel(robot.pin, robot.urdf, robot.arms, schedule.deputy.size)


def make_monitor(robot: RobotModel, schedule: Schedule, common: CommonParameters) -> ClearanceMonitor:
    """Return what measures the clearance of a run as it goes on; raises RobotDescriptionError."""
    model = make_clearance(robot, schedule)
    return ClearanceMonitor(model, schedule.grasping_arms, common.contact_depth)


def gains_by_phase(schedule: Schedule, parameters: ControllerParameters) -> tuple[Any, ...]:
    """Return the gains of the law for every phase; a phase overrides only the gains it names."""
    law, found = law_named(parameters.law), []
    for phase in schedule.phases:
        where = f"gains of phase {phase.name!r}"
        for name in phase.gains:
            require_law(name, where)
        found.append(gains_of(law, parameters, phase.gains.get(law.name, {}), where))
    return tuple(found)


def make_controller(
    robot: RobotModel,
    schedule: Schedule,
    common: CommonParameters,
    parameters: ControllerParameters,
    *,
    in_real_time: bool = False,
) -> Controller:
    """Return the controller of the scenario's law, with gains stable at the start.

    The efforts of a law of another package are checked. ``in_real_time`` the plans of a law are made in a
    process of their own. Raises ConfigurationError.
    """
    law, gains = law_named(parameters.law), gains_by_phase(schedule, parameters)
    start = robot.configuration(schedule.base_in_world, initial_joints(robot, schedule))
    compensation = _compensation(law, common, parameters)
    checked = law
    if law.linearised and compensation.integral:
        checked = replace(law, linearised=compensation.integral.linearised(law.linearised))
    check_stability(checked, robot, gains, ns_to_seconds(common.tick_ns), start)  # nothing is carried there
    computed_torque = _computed_torque(common, compensation)
    longest_ns = longest_reference_ns(common, parameters)
    preview = TargetPreview(robot, schedule) if Need.PREVIEW in law.needs else None
    distances = NearPairs(make_clearance(robot, schedule)) if Need.CLEARANCE in law.needs else None
    setup = LawSetup(
        robot,
        gains,
        common.tick_ns,
        longest_ns,
        computed_torque,
        schedule.deputy,
        reference_ns=common.reference_ns,
        preview=preview,
        distances=distances,
        compiled_derivatives=CompiledDerivatives,
        start_solver=SolverProcess if in_real_time else None,
    )
    controller = law.make(setup)
    return controller if law.name in SHIPPED else CheckedController(controller, robot.joint_names)


def _computed_torque(
    common: CommonParameters, compensation: Compensation
) -> Callable[[RobotModel], TrackingEfforts]:
    """Return what makes the computed torque of a robot."""
    make = CompiledComputedTorque if common.dynamics == COMPILED else ComputedTorque
    if not compensation.any:
        return make
    return lambda robot: CompensatedTorque(robot, make(robot), compensation)


def _compensation(law: Law[Any], common: CommonParameters, parameters: ControllerParameters) -> Compensation:
    """Return what a law compensates with; raises ConfigurationError where it cannot."""
    dt, bandwidth = ns_to_seconds(common.tick_ns), parameters.disturbance_bandwidth
    if Need.PAYLOAD not in law.needs:
        for name in ("disturbance_bandwidth", "integral_time", "friction_viscous", "friction_coulomb"):
            value = getattr(parameters, name)
            if value:
                raise ConfigurationError(
                    f"{name} is {value:g}, must be 0 under control law {law.name!r}, "
                    "which has no model of the dynamics"
                )
    if bandwidth * dt > 1.0:
        raise ConfigurationError(
            f"disturbance_bandwidth is {bandwidth:g} 1/s, must be <= {1.0 / dt:g} 1/s at a tick of {dt:g} s"
        )
    integral = IntegralAction(parameters.integral_time, dt) if parameters.integral_time else None
    friction = FrictionFeedForward(
        parameters.friction_viscous, parameters.friction_coulomb, parameters.friction_speed
    )
    has_friction = bool(friction.viscous or friction.coulomb)
    return Compensation(dt, integral, friction if has_friction else None, bandwidth or None)


def make_runner(
    plant: FreeFloatingPlant,
    controller: Controller,
    known: RobotModel,
    common: CommonParameters,
    parameters: PlantParameters,
) -> PeriodRunner:
    """Return what carries out the ticks of a period: C where dynamics are compiled and the law is ours.

    ``known`` is the robot as the law knows it. Raises ConfigurationError.
    """
    by_python = PythonRunner(plant, controller, uses_measurements=common.uses_measurements)
    if common.dynamics != COMPILED:
        return by_python
    obstacle = CompiledTicks.obstacle(plant, controller, known)
    if obstacle:
        say_once(f"ticks are carried out by Python: C does not have {obstacle}")
        return by_python
    return CompiledTicks(plant, controller, known, parameters.integrator, common.tick_ns)


@cache
def say_once(text: str) -> None:
    """Warn once in a process, however many loops it makes."""
    _LOG.warning(text)


def longest_reference_ns(common: CommonParameters, parameters: ControllerParameters) -> int:
    """Return the age in ns up to which the controller extrapolates a reference."""
    return common.reference_ns + seconds_to_ns(parameters.reference_hold)


def _check_deputy_twist(schedule: Schedule, h: float) -> None:
    """Raise ScheduleError where a deputy may turn too far in one tick of ``h`` s for its integration.

    A body that tumbles freely turns at most with |L| / I_min, with I_min its least moment of inertia.
    """
    deputy = schedule.deputy
    rate = float(np.linalg.norm(deputy.twist_in_world.angular))
    if deputy.inertia is not None:
        moments = np.array(deputy.inertia.inertia)
        turn = se3_of(deputy.deputy_in_world).rotation.T @ deputy.twist_in_world.angular
        rate = max(rate, float(np.linalg.norm(moments @ turn) / np.linalg.eigvalsh(moments)[0]))
    if rate * h > _MOST_TURN:
        raise ScheduleError(
            f"deputy.twist_in_world lets it turn at up to {rate:g} rad/s, must be at most "
            f"{_MOST_TURN / h:g} rad/s, {_MOST_TURN:g} rad in a tick of {h:g} s; use a shorter tick or a "
            "slower deputy"
        )
