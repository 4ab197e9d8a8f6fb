"""The order in which the plant publishes: first what somebody must not wait for."""

from types import SimpleNamespace
from typing import Any

import pytest

from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    DEPUTY_POSE,
    JOINT_STATES,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
)
from sms_handover.nodes.parts.plant_outputs import PlantOutputs
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import make_plant

pytestmark = pytest.mark.ros

STATE = [JOINT_STATES, BASE_ODOMETRY]
SAMPLE = [SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE]


@pytest.mark.parametrize(
    ("lockstep", "with_reference", "expected"),
    [
        (True, True, SAMPLE + STATE),  # the trajectory has most to do, and the controller waits for it
        (False, True, STATE + SAMPLE),  # the controller has to answer within the tick
        (True, False, STATE),
        (False, False, STATE),
    ],
)
def test_who_is_told_first(lockstep: bool, with_reference: bool, expected: list[str]) -> None:
    scenario = load_scenario()
    parameters = scenario.parameters
    plant = make_plant(scenario.truth.robot, scenario.truth.schedule, parameters.common, parameters.plant)
    told: dict[str, list[Any]] = {}
    order: list[str] = []

    def publisher(name: str) -> Any:
        def publish(message: Any) -> None:
            order.append(name)
            told.setdefault(name, []).append(message)

        return SimpleNamespace(publish=publish)

    outputs = PlantOutputs(scenario.truth.robot, publisher, lockstep=lockstep)
    outputs.publish_loop(plant, with_reference=with_reference)
    assert order == expected
    if with_reference:
        assert told[JOINT_STATES] == told[SAMPLED_JOINT_STATES]
