"""A controller from outside is guided over topics as it is in one process."""

from itertools import permutations

import numpy as np
import pytest
from my_controller.node import main
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd

from sms_handover.control.protocol import Guidance
from sms_handover.errors import UnknownNameError
from sms_handover.external.controller import GuidedController, OwnControllerNode
from sms_handover.graph.topics import CONTROLLER, JOINT_COMMAND, PLANT
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.types import Array, JointReference, Pose, RobotState, TaskPhase

from .bench import Bench

pytestmark = pytest.mark.ros

_HERE = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
_STATE = RobotState(0, np.zeros(21), np.zeros(20), np.zeros(14))


class Kept:
    """A controller that keeps its guidance."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.guidance: list[Guidance] = []

    def reset(self) -> None:
        """Forget it."""
        self.guidance.clear()

    def guide(self, guidance: Guidance) -> None:
        """Keep it."""
        self.guidance.append(guidance)

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Answer with how often it was guided."""
        return np.full(14, float(len(self.guidance)))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario()


def parts(guided: GuidedController, stamp: int) -> list[object]:
    """Return what gives each of the four parts of one instant."""
    reference = JointReference(stamp, np.full(14, float(stamp)), np.zeros(14))
    return [
        lambda: guided.enter(TaskPhase(stamp, 0, "approach")),
        lambda: guided.track(reference),
        lambda: guided.aim(stamp, "arm_a", _HERE),
        lambda: guided.aim(stamp, "arm_b", _HERE),
    ]


def test_guidance_is_given_once_when_all_of_one_instant_is_there(scenario: Scenario) -> None:
    """In each of the 24 orders, and never of two instants together."""
    kept = Kept()
    guided = GuidedController(kept, scenario.robot)
    assert not np.any(guided.effort(0, _STATE.q, _STATE.v))
    for number, order in enumerate(permutations(range(4))):
        for place, part in enumerate(order):
            assert len(kept.guidance) == number, place
            give = parts(guided, number)[part]
            assert callable(give)
            give()
        last = kept.guidance[-1]
        assert len(kept.guidance) == number + 1
        assert (last.phase.stamp_ns, last.reference.stamp_ns) == (number, number)
        assert list(last.tool_in_world) == ["arm_a", "arm_b"]
    assert guided.effort(0, _STATE.q, _STATE.v).tolist() == [24.0] * 14
    guided.reset()
    assert kept.guidance == [] and not np.any(guided.effort(0, _STATE.q, _STATE.v))


def test_its_parameters_are_ros_parameters_with_unit_and_range(bench: Bench) -> None:
    bench.start({"common": {"peers": (PLANT, CONTROLLER)}, CONTROLLER: {"stiffness": 6.0}})
    node = bench.add(lambda: OwnControllerNode("mine", TaskSpacePd, TaskSpaceGains))
    assert node.parameters == TaskSpaceGains(stiffness=6.0)
    assert node.get_parameter("law").value == "mine"
    described = node.describe_parameter("damping")
    assert "[N s/m]" in described.description and described.read_only
    assert described.floating_point_range[0].from_value == 0.0
    assert f"0 of 1 subscriptions of {JOINT_COMMAND}" in node.endpoints.unmatched


def test_a_parameter_it_does_not_have_is_refused(bench: Bench) -> None:
    bench.start({CONTROLLER: {"stifness": 6.0}})
    with pytest.raises(UnknownNameError, match="did you mean 'stiffness'"):
        bench.add(lambda: OwnControllerNode("mine", TaskSpacePd, TaskSpaceGains))


def test_its_help_has_the_law_and_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["node", "--help"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("task_space_pd: u = J*^T f")
    assert "stiffness = 5.0 N/m" in said and "at least 0" in said
