"""Simulate a scenario in one process: the same objects as in the graph, joined by plain calls."""

from collections.abc import Callable

from sms_handover.control.protocol import CheckedController, Controller, Guidance
from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import CONTROLLER
from sms_handover.ik.levenberg_marquardt import find_joints
from sms_handover.run_data import RunData
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.recorder import RunRecorder
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.wiring import make_controller, make_plant
from sms_handover.trajectory.generator import TrajectoryGenerator
from sms_handover.types import IkStatus, TaskPhase

Progress = Callable[[int, TaskPhase], None]


def simulate(
    scenario: Scenario | None = None,
    *,
    controller: Controller | None = None,
    progress: Progress | None = None,
) -> RunData:
    """Return the run of a scenario, by default the shipped one.

    Per tick: the plant publishes its state; each reference period the trajectory generator gives phase,
    targets and, by inverse kinematics, the joint reference; the controller answers; the plant executes grasp
    commands and integrates. The last state is answered, but not integrated. Results of grasps and inverse
    kinematics reach the generator in the next period. ``controller`` replaces that of the scenario and is
    reset first. ``progress`` is called each reference period with the time in ns and the phase. Raises
    ControllerError unless efforts are finite, and ConfigurationError for an external controller not given.
    """
    scenario = scenario or load_scenario()
    parameters, robot, schedule = scenario.parameters, scenario.robot, scenario.schedule
    common = parameters.common
    plant = make_plant(robot, schedule, common, parameters.plant)
    law: Controller
    if controller is None:
        _require_ours(common)
        law = make_controller(robot, schedule, common, parameters.controller)
    else:
        law = CheckedController(controller, robot.joint_names)
        law.reset()
    generator = TrajectoryGenerator(robot, schedule, parameters.trajectory)
    last_tick, per_reference = common.last_tick(schedule.end_ns), common.ticks_per_reference
    recorder = RunRecorder(robot.joint_names, robot.arms, last_tick + 1, last_tick // per_reference + 1)
    tick = 0
    while tick <= last_tick:
        stamp_ns = plant.stamp_ns
        if tick % per_reference == 0:
            state = plant.state
            deputy = plant.deputy
            recorder.plant(plant.tools_in_world, deputy.deputy_in_world, plant.conserved, plant.work)
            phase, targets = generator.targets(state, deputy.deputy_in_world)
            request = generator.ik_request(state, targets)
            solution = find_joints(robot, request, parameters.ik) if request.tool_in_world else None
            joints = solution.joint_position if solution else targets.joint_position
            reference, targets_in_world = generator.reference(state, targets, joints)
            recorder.reference(phase, reference, targets_in_world, solution.status if solution else None)
            law.guide(Guidance(phase, reference, targets_in_world))
            events = plant.execute(phase.commands)
            generator.grasped(events)
            if solution:
                generator.solved(converged=solution.status is IkStatus.CONVERGED)
            recorder.events(events)
            recorder.decisions(generator.take_decisions())
            before, last_tick = last_tick, common.last_tick(phase.end_ns, failed=phase.failed)
            if last_tick > before:
                recorder.make_room(last_tick + 1, last_tick // per_reference + 1)
            if progress:
                progress(stamp_ns, phase)
        effort = law.effort(stamp_ns, plant.q, plant.v)
        recorder.tick(stamp_ns, plant.q, plant.v, plant.joint_effort, effort)
        if tick < last_tick:
            plant.apply(effort)
        tick += 1
    return recorder.data()


def _require_ours(common: CommonParameters) -> None:
    """Raise ConfigurationError if the controller of the scenario is external."""
    if CONTROLLER in common.external:
        raise ConfigurationError(
            "the controller is external: pass one to simulate(), "
            "or check a recording with 'sms-handover play --closed-loop'"
        )
