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
    sampled_topics,
    state_topics,
)
from sms_handover.nodes.parts.plant_outputs import PlantOutputs
from sms_handover.simulation.parameters import LOCKSTEP, REALTIME
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import make_plant

pytestmark = pytest.mark.ros

STATE = [JOINT_STATES, BASE_ODOMETRY]
SAMPLE = [SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE]
MEASURED_STATE, MEASURED_SAMPLE = state_topics(measured=True), sampled_topics(measured=True)


@pytest.mark.parametrize(
    ("lockstep", "with_reference", "expected"),
    [
        (True, True, SAMPLE + STATE),  # the trajectory has most to do, and the controller waits for it
        (False, True, STATE + SAMPLE),  # the controller has to answer within the tick
        (True, False, STATE),
        (False, False, STATE),
    ],
)
@pytest.mark.parametrize("source", [None, "truth", "measured"])
def test_who_is_told_first(
    source: str | None, lockstep: bool, with_reference: bool, expected: list[str]
) -> None:
    """What is measured comes first where the loop goes by it, else last."""
    values: dict[str, Any] = {"common.mode": LOCKSTEP if lockstep else REALTIME}
    if source:
        values |= {"conditions.sensors.encoders": {}, "common.source": source}
    scenario = load_scenario(values=values)
    parameters, truth = scenario.parameters, scenario.truth
    common, conditions = parameters.common, truth.conditions
    plant = make_plant(truth.robot, truth.schedule, common, parameters.plant, conditions)
    told: dict[str, list[Any]] = {}
    order: list[str] = []

    def publisher(name: str) -> Any:
        def publish(message: Any) -> None:
            order.append(name)
            told.setdefault(name, []).append(message)

        return SimpleNamespace(publish=publish)

    outputs = PlantOutputs(truth.robot, publisher, common, conditions)
    outputs.publish_loop(plant, with_reference=with_reference)
    measured = [*MEASURED_SAMPLE * with_reference, *MEASURED_STATE] if source else []
    assert order == (measured + expected if source == "measured" else expected + measured)
    if with_reference:
        assert told[JOINT_STATES] == told[SAMPLED_JOINT_STATES]
