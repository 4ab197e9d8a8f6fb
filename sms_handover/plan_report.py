"""Plan report: what came of one solve of a predictive law, and where the tools go by its plan."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from sms_handover.types import Array, read_only


class PlanStatus(Enum):
    """What came of one solve of a predictive law; the value is what a user reads."""

    SOLVED = "solved"
    ITERATION_LIMIT = "no solution within the limit of iterations"
    INFEASIBLE = "no plan keeps the hard limits"
    BRAKING = "no plan for too long: the arms brake to rest"


@dataclass(frozen=True)
class PlanReport:
    """One solve of a predictive law for the state at ``stamp_ns``, or that plans are overdue in real time.

    ``plan`` is the number of the solve, ``active`` the rows of constraints that bind. ``largest_slack`` is by
    how much the worst soft limit is exceeded, in the unit of ``largest_slack_row``. Times in s are of the
    wall clock, ``plan_age`` is simulation time since the plan in use began; counts are since the start.
    """

    stamp_ns: int
    plan: int
    status: PlanStatus
    iterations: int
    active: tuple[str, ...]
    largest_slack: float
    largest_slack_row: str
    kkt_residual: float
    linearization_time: float
    program_time: float
    total_time: float
    plan_age: float
    late_plans: int = 0
    reused_plans: int = 0

    @property
    def has_solve(self) -> bool:
        """Whether a solve came of it; that the arms brake as plans are overdue is told without one."""
        return self.total_time > 0.0


@dataclass(frozen=True, eq=False)
class PlannedPaths:
    """Where the tools go by the plan in use, as seen by the solve for the state at ``stamp_ns``.

    ``tool_in_world`` has per arm the positions (K, 3) m of its tool at the instants of the horizon.
    """

    stamp_ns: int
    tool_in_world: Mapping[str, Array]

    def __post_init__(self) -> None:
        paths = {arm: read_only(path) for arm, path in self.tool_in_world.items()}
        object.__setattr__(self, "tool_in_world", MappingProxyType(paths))
