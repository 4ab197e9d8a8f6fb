"""IK node: the inverse kinematics as a service."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from sms_handover_interfaces.srv import SolveIK

from sms_handover.errors import GraphError, SmsHandoverError
from sms_handover.frames import WORLD
from sms_handover.graph.topics import IK, SOLVE_IK
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.ik.parameters import IkParameters
from sms_handover.messages.values import time_ns
from sms_handover.ros.codecs.convert import (
    joints_in_order,
    pose_of_message,
    set_ik_status,
    set_joint_positions,
)
from sms_handover.ros.codecs.validation import check_finite
from sms_handover.ros.node.diagnostics import NodeReport
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.process.main import run_node
from sms_handover.simulation.feasibility import check_feasibility
from sms_handover.types import IkRequest, IkStatus, Pose


class IkNode(GraphNode[IkParameters]):
    """Answers ``solve_ik``: the joints that bring the tools to their targets with the base locked."""

    def __init__(self) -> None:
        super().__init__(IK, IkParameters)

    def prepare(self) -> None:
        """Check that the solver reaches the targets of the schedule, and offer the service.

        The check is made here because its outcome depends on the parameters of this node; what a grasp
        tolerates is for the plant to say. Raises ScheduleError.
        """
        check_feasibility(self.robot, self.schedule, self.parameters)
        self.reset_run()
        self._names = list(self.robot.joint_names)
        self._response = SolveIK.Response(valid=True)  # refilled each time: most of it never changes
        self._response.solution.name = self._names
        self._response.status.header.frame_id = WORLD
        self.inputs.loop.create_service(SolveIK, SOLVE_IK, self._on_request)

    def reset_run(self) -> None:
        """Reset the counts; a solution depends on its request alone."""
        self._solved = dict.fromkeys(IkStatus, 0)
        self._rejected = 0
        self._stamp_ns = 0

    @property
    def awaited(self) -> str:
        """The service: the node waits for nothing else."""
        return SOLVE_IK

    def report(self) -> NodeReport:
        """Return how many requests ended in which way."""
        solved = {status.name.lower(): count for status, count in self._solved.items()}
        return NodeReport(self._stamp_ns, {**solved, "refused": self._rejected})

    def _on_request(self, request: Any) -> Any:
        """Solve one request; a malformed one is answered with ``valid`` false and the reason."""
        try:
            question = self._question(request)
        except (SmsHandoverError, ValueError) as error:
            self._rejected += 1
            return SolveIK.Response(message=str(error))
        result = solve_ik(self.robot, question, self.parameters)
        self._solved[result.status] += 1
        self._stamp_ns = stamp_ns = time_ns(request.seed.header.stamp)
        response = self._response
        set_joint_positions(response.solution, result.joint_position, stamp_ns)
        set_ik_status(response.status, result, stamp_ns)
        response.message = result.status.value
        return response

    def _question(self, request: Any) -> IkRequest:
        """Return a request as its value; raises SmsHandoverError or ValueError if it is malformed."""
        seed = joints_in_order(self._names, request.seed.name, request.seed.position)
        check_finite(seed, "the seed")
        targets: dict[str, Pose] = {}
        for arm, message in zip(request.arms, request.tool_in_world, strict=True):
            self.robot.require_arm(arm)
            if arm in targets:
                raise GraphError(f"there are two targets for {arm}")
            targets[arm] = _pose(message, f"the target of {arm}")
        return IkRequest(_pose(request.base_in_world, "the pose of the base"), seed, targets)


def _pose(message: Any, name: str) -> Pose:
    """Return the pose in a message; raises GraphError if it is none."""
    pose = pose_of_message(message)
    check_finite(pose.position, name)
    check_finite(pose.quaternion_xyzw, name)
    if not np.count_nonzero(pose.quaternion_xyzw):
        raise GraphError(f"{name} has no orientation: its quaternion is zero")
    return pose


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(IkNode, args, name=IK)


if __name__ == "__main__":
    raise SystemExit(main())
