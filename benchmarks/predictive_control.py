"""Predictive control: processor time of a solve with all constraints, beside its unavoidable parts.

These are Pinocchio's derivatives of dynamics, tools and distances, and DAQP on the finished program; what a
solve takes beyond them is condensing and the assembly of rows.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from benchmarks.machine import versions
from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import interleaved
from sms_handover.compiled.linearisation import CompiledDerivatives
from sms_handover.control.mpc.controller import MpcController
from sms_handover.control.mpc.distance_rows import DistanceModel
from sms_handover.control.mpc.momentum import base_start
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.placement import placements
from sms_handover.control.mpc.planner import Planner, PlanStart, Program
from sms_handover.control.mpc.prediction import PredictionModel
from sms_handover.control.mpc.quadratic_program import solve
from sms_handover.control.mpc.tool_errors import ToolErrorModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import gains_by_phase, make_clearance
from sms_handover.trajectory.preview import TargetPreview
from sms_handover.types import BASE_NQ, BASE_NV, Array
from sms_handover.units import seconds_to_ns

INTERVALS = (10, 15, 20)  # [-] of the horizon
STATES = 20  # [-] reference periods of the task, from each of which one solve is taken
ROUNDS = 2  # [-] of which the shortest counts
LIMITS: Mapping[str, object] = {"base_attitude_limit": 0.07}  # rad, besides those of scenario `tight`
WHOLE, PARTS = "whole", "parts"
_MS_PER_S = 1000.0  # [ms/s]


@dataclass(frozen=True, eq=False)
class Problem:
    """What one solve is given."""

    start: PlanStart
    accelerations: Array
    targets: tuple[PreviewedTargets, ...]


class Contest:
    """Solves from the beginning of the task, with some intervals in the horizon."""

    def __init__(self, intervals: int) -> None:
        """Run the beginning of the task and keep the problem of each period."""
        controller = {**LIMITS, "plan_intervals": intervals}
        scenario = load_scenario("tight", {"controller": controller})
        robot, schedule = scenario.model.robot, scenario.model.schedule
        gains: MpcGains = gains_by_phase(schedule, scenario.parameters.controller)[0]
        distances = NearPairs(make_clearance(robot, schedule))
        self.planner = Planner(robot, gains, distances, np.eye(3))
        self._compiled = Planner(robot, gains, distances, np.eye(3), CompiledDerivatives)
        self._prediction, self._tools = PredictionModel(robot), ToolErrorModel(robot)
        self._distances = DistanceModel(robot, distances, gains.distance_pairs, gains.least_distance)
        loop, preview = Loop(scenario), TargetPreview(robot, schedule)
        inner = loop.controller
        assert isinstance(inner, MpcController)
        self.problems = list[Problem]()
        for _ in range(STATES):
            state, period = loop.state, loop.advance_period().period
            assert period is not None and inner.plan is not None
            preview.update(period.phase, period.reference, period.targets_in_world, state.q, state.v)
            start = PlanStart(state.q[BASE_NQ:], state.v[BASE_NV:], base_start(robot, state.q, state.v))
            times = self.planner.horizon.times[1:].tolist()
            targets = preview.ahead([state.stamp_ns + seconds_to_ns(time) for time in times])
            accelerations = inner.plan.resampled(self.planner.horizon, state.stamp_ns)
            self.problems.append(Problem(start, accelerations, targets))

    def whole(self, problem: Problem) -> None:
        """Carry out one iteration as the law does."""
        self.planner.step(problem.start, problem.accelerations, problem.targets)

    def compiled(self, problem: Problem) -> None:
        """Carry out one iteration with the dynamics linearised in C."""
        self._compiled.step(problem.start, problem.accelerations, problem.targets)

    def dynamics(self, problem: Problem) -> None:
        """Predict the motion with the derivatives of dynamics alone, and do nothing with them."""
        start = problem.start
        self._prediction.predict(self.planner.horizon, start.base, start.q, start.w, problem.accelerations)

    def derivatives(self, problem: Problem) -> None:
        """Find the derivatives of all outputs, and do nothing with them."""
        horizon, start = self.planner.horizon, problem.start
        found = self._prediction.predict(horizon, start.base, start.q, start.w, problem.accelerations)
        placed = placements(found)
        self._tools.at(placed[1:], problem.targets)
        self._distances.at(placed, problem.targets)

    def programs(self) -> list[Program]:
        """Return the finished quadratic programs."""
        return [self.planner.program(item.start, item.accelerations, item.targets) for item in self.problems]

    def solve(self, program: Program) -> None:
        """Solve a finished program."""
        solve(program.hessian, program.gradient, program.constraints, self.planner.gains.program_iterations)


def shortest(run: Callable[[], None]) -> float:
    """Return the shortest processor time of some calls, s."""
    return interleaved({WHOLE: run}, ROUNDS, process_time).best(WHOLE)


def main() -> None:
    """Measure horizons of several lengths."""
    rows, values = [], {}
    for intervals in INTERVALS:
        contest = Contest(intervals)
        whole = [shortest(partial(contest.whole, problem)) for problem in contest.problems]
        compiled = [shortest(partial(contest.compiled, problem)) for problem in contest.problems]
        dynamics = [shortest(partial(contest.dynamics, problem)) for problem in contest.problems]
        derivatives = [shortest(partial(contest.derivatives, problem)) for problem in contest.problems]
        programs = [shortest(partial(contest.solve, program)) for program in contest.programs()]
        parts = float(np.median(np.add(derivatives, programs)))
        median, tail = float(np.median(whole)), float(np.percentile(whole, 99.0))
        parts_of = (compiled, dynamics, derivatives, programs)
        numbers = (median, tail, *(float(np.median(each)) for each in parts_of))
        rows.append(row(str(intervals), *(number * _MS_PER_S for number in numbers), median / parts))
        values[str(intervals)] = {WHOLE: median, "tail": tail, PARTS: parts}
    heading = (
        *("intervals", "solve, median [ms]", "99th percentile [ms]", "dynamics in C: median [ms]"),
        *("dynamics [ms]", "derivatives [ms]", "program [ms]"),
    )
    publish(
        Result(
            name="predictive_control",
            question="How long does a solve of the predictive law take?",
            tables=[Table([*heading, "solve over both"], rows)],
            notes=[
                f"Processor time of one iteration at each of the first {STATES} reference periods of "
                "scenario `tight`, with the base's rotation limited too; the shortest of some counts. "
                "Derivatives are Pinocchio's, of dynamics, tools and distances; the column before has those "
                "of dynamics alone. The program is DAQP with its checks. "
                f"Compared: {versions(('pin', 'daqp', 'casadi', 'numpy'))}.",
            ],
            values=values,
        )
    )


if __name__ == "__main__":
    main()
