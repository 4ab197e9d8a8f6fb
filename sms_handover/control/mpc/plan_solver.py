"""Solver of the problems of plans, in the process of the controller or in one of its own."""

from collections.abc import Sequence

from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.planner import Planner, Step
from sms_handover.control.protocol import Distances
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.known_payload import EMPTY_HANDS, KnownPayload
from sms_handover.model.robot_model import RobotModel


class PlanSolver:
    """Solves under the parameters of each phase, with the robot and what it holds; not thread-safe."""

    def __init__(
        self,
        robot: RobotModel,
        deputy: DeputyDescription | None,
        gains: Sequence[MpcGains],
        distances: Distances,
    ) -> None:
        """Begin with empty hands; ``gains`` has one set per phase."""
        self._payload, self._gains, self._distances = KnownPayload(robot, deputy), gains, distances
        self._planners: dict[MpcGains, Planner] = {}
        self._made_for = EMPTY_HANDS, b""  # what is held, and the attitude to keep

    def solve(self, problem: PlanProblem) -> Step:
        """Return one iteration."""
        made_for = problem.grip, problem.initial_rotation.tobytes()
        if made_for != self._made_for:
            self._made_for = made_for
            self._payload.hold(problem.grip)
            self._planners.clear()
        gains = self._gains[problem.phase_index]
        if gains not in self._planners:
            robot, initial = self._payload.robot, problem.initial_rotation
            self._planners[gains] = Planner(robot, gains, self._distances, initial)
        planner = self._planners[gains]
        step = planner.step(problem.start, problem.accelerations, problem.targets, shown=problem.is_shown)
        return step
