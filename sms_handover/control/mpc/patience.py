"""Patience of the law ``mpc``: how often the arms may have to brake before the law gives the task up."""

from dataclasses import dataclass

from sms_handover.control.mpc.plan_queue import PlanQueue
from sms_handover.control.mpc.quadratic_program import Solution
from sms_handover.errors import NoPlanError
from sms_handover.units import ns_to_seconds, seconds_to_ns

_MOST = 3  # [-] times, without plans for a whole horizon in between
_SETTLING = 0.5  # [s] that the joints have after the plan by which they brake
_UNITS = {  # of rows, by how their names begin
    "effort": "N m",
    "position": "rad",
    "rate": "rad/s",
    "base rate": "rad/s",
    "base attitude": "rad",
    "distance": "m",
}


@dataclass(frozen=True)
class PatienceState:
    """Solves in a row that gave a plan, how often there was none for long, and at last why."""

    lasting: int
    brakings: int
    hindrance: str


class Patience:
    """Ends a run that cannot be carried out within its limits, once the arms are at rest, and names a limit.

    Once is no reason: the arms brake, and planning begins anew. If that happens three times and plans never
    last for a horizon, nothing is planned any more.
    """

    def __init__(self, period_ns: int) -> None:
        """Count solves that are ``period_ns`` apart."""
        self._period_s = ns_to_seconds(period_ns)
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self.restore(PatienceState(0, 0, ""))

    @property
    def state(self) -> PatienceState:
        """What later decisions depend on."""
        return self._state

    def restore(self, state: PatienceState) -> None:
        """Go back to a former :attr:`state`."""
        self._state = state

    @property
    def is_over(self) -> bool:
        """Whether nothing is to be planned any more."""
        return bool(self._state.hindrance)

    def solved(self, horizon: float) -> None:
        """Count a plan that looks ``horizon`` s ahead."""
        lasting = self._state.lasting + 1
        brakings = 0 if lasting * self._period_s >= horizon else self._state.brakings
        self._state = PatienceState(lasting, brakings, "")

    def brakes(self, solution: Solution) -> None:
        """Count that the arms have to brake, or still have no plan, because of what came of a program."""
        brakings = self._state.brakings + 1
        self._state = PatienceState(0, brakings, _hindrance(solution) if brakings == _MOST else "")

    def is_at_rest(self, stamp_ns: int, queue: PlanQueue) -> bool:
        """Return whether the last plan, by which the arms brake, is over and they have settled."""
        plan = queue.plan
        assert plan is not None
        return not queue.coming and stamp_ns > plan.begin_ns + seconds_to_ns(plan.end_s + _SETTLING)

    def error(self, stamp_ns: int, excess: float, row: str) -> NoPlanError:
        """Return the error that names the limit exceeded at rest, or else that of the last program."""
        return no_plan(stamp_ns, _in_words(row, excess) if row else self._state.hindrance)


def no_plan(stamp_ns: int, reason: str) -> NoPlanError:
    """Return the error that tells why the arms are at rest."""
    at_s = ns_to_seconds(stamp_ns)
    return NoPlanError(
        f"control law 'mpc' has no plan within its limits, the arms are at rest at {at_s:g} s: {reason}"
    )


def _hindrance(solution: Solution) -> str:
    """Return what keeps a program from a solution."""
    if solution.largest_slack_row:
        return _in_words(solution.largest_slack_row, solution.largest_slack)
    return f"its programs end after {solution.iterations} iterations, allow more (program_iterations)"


def _in_words(row: str, excess: float) -> str:
    """Return which limit is in the way, and what to do."""
    unit = next(unit for kind, unit in _UNITS.items() if row.startswith(kind))
    return f"{row} exceeds its limit by {excess:.3g} {unit}, relax it or give the task more room"
