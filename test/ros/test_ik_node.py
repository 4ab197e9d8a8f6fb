"""The IK service answers whatever it is asked: a solution with its status, or why there is none."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import IkStatus as IkStatusMessage
from sms_handover_interfaces.srv import SolveIK

from sms_handover.errors import ScheduleError
from sms_handover.graph.topics import SOLVE_IK
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.messages.values import header_ns
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.codecs.convert import joints_in_order, set_joint_positions, set_pose
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import initial_joints
from sms_handover.types import Array, IkRequest, IkStatus, Pose

from .bench import Bench
from .short_handover import short_handover

pytestmark = pytest.mark.ros

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
AT_ORIGIN = Pose(np.zeros(3), LEVEL)


def joint_positions(names: Sequence[str], position: Array, stamp_ns: int) -> Any:
    return set_joint_positions(JointState(name=list(names)), position, stamp_ns)


class Asker:
    """A node that asks the IK node."""

    def __init__(self, bench: Bench, **parameters: object) -> None:
        """Start the service and find it."""
        bench.start({"common": {"peers": ("ik",)}, "ik": parameters})
        self.bench = bench
        self.node = bench.add(IkNode)
        self.scenario = load_scenario()
        self.robot = self.scenario.truth.robot
        self.seed = initial_joints(self.robot, self.scenario.truth.schedule)
        self._client = bench.plain("client").create_client(SolveIK, SOLVE_IK)
        bench.until(self._client.service_is_ready, "the service")

    def ask(self, request: Any) -> Any:
        """Return the answer to a request."""
        return self.bench.result(self._client.call_async(request))

    def near(self, arm: str, offset: Array) -> Pose:
        """Return the pose of a tool at the seed, moved by ``offset`` m."""
        tool = self.robot.tools_in_world(AT_ORIGIN, self.seed)[arm]
        return Pose(tool.position + offset, tool.quaternion_xyzw)

    def request(self, stamp_ns: int = 0, **targets: Pose) -> Any:
        """Return a good request."""
        return SolveIK.Request(
            base_in_world=set_pose(PoseMessage(), AT_ORIGIN),
            seed=joint_positions(self.robot.joint_names, self.seed, stamp_ns),
            arms=list(targets),
            tool_in_world=[set_pose(PoseMessage(), pose) for pose in targets.values()],
        )


@pytest.fixture
def asker(bench: Bench) -> Asker:
    return Asker(bench)


def test_answer_is_that_of_the_solver_bit_for_bit(asker: Asker) -> None:
    targets = {
        "arm_b": asker.near("arm_b", np.array([0.01, -0.02, 0.03])),
        "arm_a": asker.near("arm_a", np.array([0.02, 0.01, -0.01])),
    }
    answer = asker.ask(asker.request(7_000_000_001, **targets))
    question = IkRequest(AT_ORIGIN, asker.seed, targets)
    expected = solve_ik(asker.robot, question, asker.scenario.parameters.ik)
    solution = joints_in_order(asker.robot.joint_names, answer.solution.name, answer.solution.position)
    assert solution.tobytes() == expected.joint_position.tobytes()
    assert answer.valid
    assert answer.message == IkStatus.CONVERGED.value
    assert answer.status.status == IkStatusMessage.CONVERGED
    assert answer.status.iterations == expected.iterations
    assert header_ns(answer.solution) == header_ns(answer.status) == 7_000_000_001
    assert (answer.status.position_error, answer.status.limit_margin) == (
        expected.position_error,
        expected.limit_margin,
    )
    assert asker.node.report().values["converged"] == 1


def test_seed_is_matched_by_name(asker: Asker) -> None:
    target = asker.near("arm_a", np.array([0.01, 0.0, 0.02]))
    straight = asker.request(arm_a=target)
    turned = asker.request(arm_a=target)
    turned.seed = joint_positions(asker.robot.joint_names[::-1], asker.seed[::-1], 0)
    assert asker.ask(turned).solution == asker.ask(straight).solution


def test_without_targets_the_seed_comes_back(asker: Asker) -> None:
    answer = asker.ask(asker.request())
    assert answer.valid
    assert answer.solution.position.tolist() == asker.seed.tolist()


@pytest.mark.parametrize("away", [3.0, 100.0, 1e6])
def test_out_of_reach_gets_the_best_effort_and_says_so(asker: Asker, away: float) -> None:
    answer = asker.ask(asker.request(arm_a=asker.near("arm_a", np.array([away, 0.0, 0.0]))))
    assert answer.valid
    assert answer.status.status in (IkStatusMessage.STALLED, IkStatusMessage.ITERATION_LIMIT)
    assert away - 2.0 < answer.status.position_error < away + 0.1
    solution = np.array(answer.solution.position)
    assert np.all(solution >= asker.robot.lower) and np.all(solution <= asker.robot.upper)
    tool = asker.robot.tools_in_world(AT_ORIGIN, solution)["arm_a"]
    assert tool.position[0] > asker.near("arm_a", np.zeros(3)).position[0]  # it has stretched towards it


def test_a_stall_is_told(bench: Bench) -> None:
    """With steps of 10 mrad taken for none, the solver stands still long before the iteration limit."""
    asker = Asker(bench, stall_step=1e-2, position_tolerance=1e-2, orientation_tolerance=1e-2)
    answer = asker.ask(asker.request(arm_a=asker.near("arm_a", np.array([1.5, 0.0, 0.0]))))
    assert answer.valid
    assert answer.status.status == IkStatusMessage.STALLED
    assert answer.message == IkStatus.STALLED.value
    assert asker.node.report().values["stalled"] == 1


def test_values_of_robot_and_deputy_come_with_the_parameters(bench: Bench) -> None:
    bench.start({"common": {"values": ("robot.base.mass:=300", "robot.arms.arm_a.gripper.mass:=0.9")}})
    node = bench.add(IkNode)
    assert node.robot.mass == pytest.approx(load_scenario().truth.robot.mass + 60.0 + 0.9 - 0.6451)


LOOSE = {"position_tolerance": 9.0, "orientation_tolerance": 9.0}


@pytest.mark.parametrize(
    ("far", "parameters", "is_refused"),
    [(False, {}, False), (False, {"stall_step": 0.1}, True), (True, {}, True), (True, LOOSE, False)],
)
def test_the_schedule_is_checked_with_the_parameters_of_this_node(
    bench: Bench, far: bool, parameters: dict[str, object], is_refused: bool
) -> None:
    """Whether a target is in reach depends on them; no other node has an opinion of its own."""
    schedule = yaml.safe_load(short_handover())
    if far:
        schedule["phases"][1]["arms"]["arm_a"] = "hold"
        schedule["phases"][1]["arms"]["arm_b"]["tool_in_world"]["xyz"] = [4.0, 0.0, 0.0]
    path = bench.folder / "schedule.yaml"
    path.write_text(yaml.safe_dump(schedule), encoding="utf-8")
    bench.start({"common": {"schedule": str(path)}, "ik": parameters})
    bench.add(TrajectoryNode)
    if is_refused:
        with pytest.raises(ScheduleError, match=r"the target of arm_\w .* is out of reach"):
            bench.add(IkNode)
    else:
        bench.add(IkNode)


Spoil = Callable[[Any], None]


def without_a_joint(request: Any) -> None:
    request.seed.name = list(request.seed.name)[:-1]
    request.seed.position = list(request.seed.position)[:-1]


def without_an_angle(request: Any) -> None:
    request.seed.position = list(request.seed.position)[:-1]


def without_a_seed(request: Any) -> None:
    request.seed.name = []
    request.seed.position = []


def for_a_third_arm(request: Any) -> None:
    request.arms = ["arm_c"]


def without_a_pose(request: Any) -> None:
    request.tool_in_world = []


def with_a_pose_too_many(request: Any) -> None:
    request.tool_in_world = [*request.tool_in_world, PoseMessage()]


def for_an_arm_twice(request: Any) -> None:
    request.arms = ["arm_a", "arm_a"]
    request.tool_in_world = [request.tool_in_world[0], request.tool_in_world[0]]


def with_a_target_that_is_no_number(request: Any) -> None:
    request.tool_in_world[0].position.x = float("nan")


def with_an_infinite_target(request: Any) -> None:
    request.tool_in_world[0].position.x = float("inf")


def with_a_seed_that_is_no_number(request: Any) -> None:
    request.seed.position = [float("nan"), *list(request.seed.position)[1:]]


def with_a_base_that_is_no_number(request: Any) -> None:
    request.base_in_world.position.z = float("nan")


def with_a_target_that_is_no_rotation(request: Any) -> None:
    request.tool_in_world[0].orientation.x = 0.0
    request.tool_in_world[0].orientation.y = 0.0
    request.tool_in_world[0].orientation.z = 0.0
    request.tool_in_world[0].orientation.w = 0.0


def with_a_base_that_is_no_rotation(request: Any) -> None:
    request.base_in_world = PoseMessage()
    request.base_in_world.orientation.w = 0.0


MALFORMED: dict[Spoil, str] = {
    without_a_joint: "lacks 'arm_b_joint_7'",
    without_an_angle: "14 names and 13 values",
    without_a_seed: "lacks 'arm_a_joint_1'",
    for_a_third_arm: "unknown arm 'arm_c'",
    without_a_pose: "argument 2 is shorter",
    with_a_pose_too_many: "argument 2 is longer",
    for_an_arm_twice: "two targets for arm_a",
    with_a_target_that_is_no_number: "the target of arm_a is not finite",
    with_an_infinite_target: "the target of arm_a is not finite",
    with_a_seed_that_is_no_number: "the seed is not finite",
    with_a_base_that_is_no_number: "the pose of the base is not finite",
    with_a_target_that_is_no_rotation: "the target of arm_a has no orientation",
    with_a_base_that_is_no_rotation: "the pose of the base has no orientation",
}


@pytest.mark.parametrize("spoil", list(MALFORMED), ids=lambda spoil: spoil.__name__)
def test_a_malformed_request_is_refused_with_the_reason(asker: Asker, spoil: Spoil) -> None:
    request = asker.request(arm_a=asker.near("arm_a", np.array([0.01, 0.0, 0.0])))
    spoil(request)
    answer = asker.ask(request)
    assert not answer.valid
    assert MALFORMED[spoil] in answer.message
    assert "\n" not in answer.message
    assert len(answer.solution.position) == 0
    assert asker.node.report().values["refused"] == 1
    good = asker.ask(asker.request(arm_a=asker.near("arm_a", np.array([0.01, 0.0, 0.0]))))
    assert good.valid and good.status.status == IkStatusMessage.CONVERGED


def test_a_quaternion_of_any_length_is_a_rotation(asker: Asker) -> None:
    """Senders round; what counts is the direction."""
    request = asker.request(arm_a=asker.near("arm_a", np.array([0.01, 0.0, 0.0])))
    turn = request.tool_in_world[0].orientation
    for name in "xyzw":
        setattr(turn, name, 1.001 * getattr(turn, name))
    assert asker.ask(request).status.status == IkStatusMessage.CONVERGED
