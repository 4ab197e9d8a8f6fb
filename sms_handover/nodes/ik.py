"""The inverse-kinematics service node."""

from collections.abc import Sequence
from typing import Any

from sms_handover_interfaces.srv import SolveIK

from sms_handover.errors import SmsHandoverError
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.ik.parameters import IkParameters
from sms_handover.ros.convert import (
    ik_status_message,
    joint_positions_message,
    joints_in_order,
    pose_of_message,
    stamp_ns_of,
)
from sms_handover.ros.graph_node import GraphNode
from sms_handover.ros.main import run_node
from sms_handover.topics import IK, SOLVE_IK
from sms_handover.types import IkRequest, IkStatus


class IkNode(GraphNode[IkParameters]):
    """Answers ``solve_ik``: the joints that bring the tools to their targets with the base locked."""

    def __init__(self) -> None:
        """Offer the service."""
        super().__init__(IK, IkParameters)
        self._solved = dict.fromkeys(IkStatus, 0)
        self._refused = 0
        self.create_service(SolveIK, SOLVE_IK, self._on_request)

    def diagnostic_values(self) -> dict[str, object]:
        """Return how many requests ended in which way."""
        solved: dict[str, object] = {status.name.lower(): count for status, count in self._solved.items()}
        return {**solved, "refused": self._refused}

    def _on_request(self, request: Any, response: Any) -> Any:
        """Solve one request; a malformed one is answered with ``valid`` false and the reason."""
        try:
            seed = joints_in_order(self.robot.joint_names, request.seed.name, request.seed.position)
            for arm in request.arms:
                self.robot.require_arm(arm)
            targets = zip(request.arms, map(pose_of_message, request.tool_in_world), strict=True)
            question = IkRequest(pose_of_message(request.base_in_world), seed, dict(targets))
        except (SmsHandoverError, ValueError) as error:
            self._refused += 1
            response.message = str(error)
            return response
        result = solve_ik(self.robot, question, self.parameters)
        self._solved[result.status] += 1
        stamp_ns = stamp_ns_of(request.seed.header.stamp)
        response.solution = joint_positions_message(self.robot.joint_names, result.joint_position, stamp_ns)
        response.status = ik_status_message(result, stamp_ns)
        response.valid = True
        response.message = result.status.value
        return response


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(IkNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
