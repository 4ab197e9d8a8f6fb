"""Everything that can be wrong with a scenario, found before any node is started."""

from sms_handover.simulation.feasibility import check_feasibility
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.wiring import make_controller, make_plant


def check(scenario: Scenario) -> None:
    """Raise ConfigurationError where the scenario cannot be run, before any node is started."""
    parameters, robot, schedule = scenario.parameters, scenario.robot, scenario.schedule
    make_plant(robot, schedule, parameters.common, parameters.plant)
    make_controller(robot, schedule, parameters.common, parameters.controller)
    check_feasibility(scenario)
