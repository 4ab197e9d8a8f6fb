"""Check of a whole scenario before anything moves."""

from sms_handover.control.registry import law_named
from sms_handover.graph.topics import CONTROLLER
from sms_handover.simulation.feasibility import PhasePrediction, check_feasibility
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.stability import check_stability_by_phase
from sms_handover.simulation.wiring import gains_by_phase, make_controller, make_plant
from sms_handover.units import ns_to_seconds


def check_scenario(scenario: Scenario) -> tuple[PhasePrediction, ...]:
    """Return where each phase will end; raises ConfigurationError where the scenario cannot be run.

    Beyond what making the parts of the loop checks, every target must be in reach, every grasp must
    meet its frame, and the sampled loop must be stable where each phase ends, not only at the start: the
    reduced inertia falls where wrist axes come into line. Of an external controller nothing is known. What is
    checked is the model: how far the truth is from it, nobody knows before a run.
    """
    parameters, truth = scenario.parameters, scenario.truth
    robot, schedule = scenario.model.robot, scenario.model.schedule
    make_plant(truth.robot, truth.schedule, parameters.common, parameters.plant, truth.conditions)
    ours = CONTROLLER not in parameters.common.external
    if ours:
        make_controller(robot, schedule, parameters.common, parameters.controller)
    predictions = check_feasibility(robot, schedule, parameters.ik, parameters.plant.grasp_tolerance)
    if not ours:
        return predictions
    gains = gains_by_phase(schedule, parameters.controller)
    law = law_named(parameters.controller.law)
    places = [
        (robot.configuration(end.base_in_world, end.joint_position), f"where phase {end.phase!r} ends")
        for end in predictions
    ]
    check_stability_by_phase(law, robot, schedule, gains, ns_to_seconds(parameters.common.tick_ns), places)
    return predictions
