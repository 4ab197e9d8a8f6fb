"""A controller from outside is guided over topics as it is in one process."""

from itertools import permutations

import numpy as np
import pytest
from my_controller.node import main
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd

from sms_handover.errors import UnknownNameError
from sms_handover.external.controller import OwnControllerNode
from sms_handover.graph.topics import CONTROLLER, JOINT_COMMAND, JOINT_REFERENCE, PLANT, TASK_PHASE
from sms_handover.nodes.parts.guidance_parts import GuidanceParts
from sms_handover.types import Pose, TaskPhase

from .bench import Bench

pytestmark = pytest.mark.ros

_HERE = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


@pytest.mark.parametrize("arms", [(), ("arm_a", "arm_b")])
def test_guidance_is_given_once_when_all_of_one_instant_is_there(arms: tuple[str, ...]) -> None:
    """In each order of its parts, and never of two instants together."""
    parts = GuidanceParts(arms)
    for stamp, order in enumerate(permutations(parts.topics), start=1):
        contents: dict[str, object] = dict.fromkeys(order, _HERE)
        contents[TASK_PHASE] = TaskPhase(stamp, 0, "approach")
        contents[JOINT_REFERENCE] = (np.full(14, float(stamp)), np.zeros(14))
        *missing, last = (parts.add(topic, stamp, contents[topic]) for topic in order)
        assert missing == [None] * (len(order) - 1)
        assert last is not None and list(last.tool_in_world) == list(arms)
        assert (last.phase.stamp_ns, last.reference.stamp_ns, parts.reference_ns) == (stamp, stamp, stamp)
    assert parts.complete
    parts.reset()
    assert not parts.complete


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
