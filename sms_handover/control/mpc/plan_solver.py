"""Solver of the problems of plans, in the process of the controller or in one of its own."""

from collections.abc import Callable, Sequence

import numpy as np

from sms_handover.control.mpc.derivatives import (
    COMPILED,
    PINOCCHIO,
    DynamicsDerivatives,
    PinocchioDerivatives,
)
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.plan_problem import PlanProblem
from sms_handover.control.mpc.planner import Planner, Step
from sms_handover.control.mpc.quadratic_program import worst_excess
from sms_handover.control.protocol import Distances
from sms_handover.errors import ConfigurationError
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.known_payload import EMPTY_HANDS, KnownPayload
from sms_handover.model.robot_model import RobotModel

MakeDerivatives = Callable[[RobotModel], DynamicsDerivatives]


class PlanSolver:
    """Solves under the parameters of each phase, with the robot and what it holds; not thread-safe."""

    def __init__(
        self,
        robot: RobotModel,
        deputy: DeputyDescription | None,
        gains: Sequence[MpcGains],
        distances: Distances,
        compiled: MakeDerivatives | None,
    ) -> None:
        """Begin with empty hands; ``gains`` has one set per phase.

        ``compiled`` makes the derivatives of a robot as C where parameters ask for it.
        """
        self._made_by = {PINOCCHIO: PinocchioDerivatives, COMPILED: compiled}
        self._payload, self._gains, self._distances = KnownPayload(robot, deputy), gains, distances
        self._planners: dict[MpcGains, Planner] = {}
        self._made_for = EMPTY_HANDS, b""  # what is held, and the attitude to keep

    def solve(self, problem: PlanProblem) -> Step:
        """Return one iteration."""
        planner = self._planner(problem)
        return planner.step(problem.start, problem.accelerations, problem.targets, shown=problem.is_shown)

    def exceeded(self, problem: PlanProblem) -> tuple[float, str]:
        """Return by how much the worst soft limit is exceeded without a change, and its row, '' for none."""
        planner = self._planner(problem)
        program = planner.program(problem.start, problem.accelerations, problem.targets)
        return worst_excess(program.constraints, np.zeros(problem.accelerations.size), soft=True)

    def _planner(self, problem: PlanProblem) -> Planner:
        """Return the planner of a problem."""
        made_for = problem.grip, problem.initial_rotation.tobytes()
        if made_for != self._made_for:
            self._made_for = made_for
            self._payload.hold(problem.grip)
            self._planners.clear()
        gains = self._gains[problem.phase_index]
        if gains not in self._planners:
            robot, initial = self._payload.robot, problem.initial_rotation
            derivatives = self._made_by[gains.linearisation]
            if derivatives is None:
                raise ConfigurationError("linearisation 'compiled' of control law 'mpc' is not there")
            self._planners[gains] = Planner(robot, gains, self._distances, initial, derivatives)
        return self._planners[gains]
