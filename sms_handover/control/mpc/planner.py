"""Planner: one real-time iteration, a sequential quadratic step about the plan before [Diehl2005]."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter

from sms_handover.control.mpc.constraints import Constraint, Limits
from sms_handover.control.mpc.cost import PlanCost
from sms_handover.control.mpc.derivatives import DynamicsDerivatives, PinocchioDerivatives
from sms_handover.control.mpc.distance_rows import DistanceModel
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.momentum import BaseStart
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.placement import Placement, placements
from sms_handover.control.mpc.prediction import PredictionModel
from sms_handover.control.mpc.quadratic_program import Solution, solve
from sms_handover.control.mpc.sensitivity import Sensitivity
from sms_handover.control.mpc.tool_errors import ToolErrorModel
from sms_handover.control.protocol import Distances
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array


@dataclass(frozen=True, eq=False)
class PlanStart:
    """Where a plan begins: joint angles and rates (n,), and what the base's motion depends on."""

    q: Array
    w: Array
    base: BaseStart


@dataclass(frozen=True, eq=False)
class Program:
    """A quadratic program in the changes of the accelerations (N n,): Hessian, gradient and constraints.

    ``placed`` is where the robot is at the instants of the horizon without changes.
    """

    hessian: Array
    gradient: Array
    constraints: Sequence[Constraint]
    placed: Sequence[Placement]


@dataclass(frozen=True, eq=False)
class Step:
    """One iteration: what the program gave, and how long its parts took, s of wall time.

    ``paths`` are those of the tools (N + 1, 3) m per arm, by the accelerations that it began with, or empty.
    """

    solution: Solution
    linearization_time: float
    program_time: float
    paths: Mapping[str, Array]


def horizon_of(gains: MpcGains) -> Horizon:
    """Return the horizon that parameters ask for; raises ConfigurationError."""
    return Horizon.growing(gains.plan_horizon, gains.plan_intervals, gains.plan_first_interval)


class Planner:
    """Plans under one set of parameters; owns work space, so it is not to be shared between threads."""

    def __init__(
        self,
        robot: RobotModel,
        gains: MpcGains,
        distances: Distances | None,
        initial_rotation: Array,
        derivatives: Callable[[RobotModel], DynamicsDerivatives] = PinocchioDerivatives,
    ) -> None:
        """Keep the base's attitude about an initial one (3, 3); raises ConfigurationError."""
        self.gains = gains
        self.horizon = horizon_of(gains)
        self.prediction = PredictionModel(robot, derivatives)
        self._tools, self._cost = ToolErrorModel(robot), PlanCost(robot, gains, self.horizon)
        self._limits = Limits(robot, gains, initial_rotation)
        self._distances: DistanceModel | None = None
        if distances and distances.pairs and gains.least_distance > 0.0:
            least = (1.0 + gains.limit_margin) * gains.least_distance
            self._distances = DistanceModel(robot, distances, gains.distance_pairs, least)

    def step(
        self,
        start: PlanStart,
        accelerations: Array,
        targets: Sequence[PreviewedTargets],
        *,
        shown: bool = False,
    ) -> Step:
        """Return one iteration about accelerations (N, n), towards targets at all instants but the first.

        With the paths of the tools if they are to be ``shown``.
        """
        begun = perf_counter()
        program = self.program(start, accelerations, targets)
        linearized = perf_counter()
        solution = solve(
            program.hessian, program.gradient, program.constraints, self.gains.program_iterations
        )
        solved = perf_counter()
        paths = self._tools.paths(program.placed) if shown else {}
        return Step(solution, linearized - begun, solved - linearized, paths)

    def program(self, start: PlanStart, accelerations: Array, targets: Sequence[PreviewedTargets]) -> Program:
        """Return the quadratic program about accelerations (N, n)."""
        horizon = self.horizon
        prediction = self.prediction.predict(horizon, start.base, start.q, start.w, accelerations)
        placed = placements(prediction)
        errors = self._tools.at(placed[1:], targets)
        distances = self._distances.at(placed, targets) if self._distances else None
        sensitivity = Sensitivity(horizon, prediction)
        hessian, gradient = self._cost.quadratic(prediction, accelerations, sensitivity, errors, targets)
        constraints = self._limits.constraints(horizon, prediction, sensitivity, distances)
        return Program(hessian, gradient, constraints, placed)
