"""Message constants: the number by which each enum member stands in a message, as ``interfaces/msg`` has it.

They are written out because bags keep them: the order of the members in the code must not matter.
"""

from collections.abc import Mapping
from enum import Enum
from typing import TypeVar

from sms_handover.graph.events import Severity
from sms_handover.plan_report import PlanStatus
from sms_handover.types import GraspAction, GraspStatus, IkStatus, PhaseState

E = TypeVar("E", bound=Enum)

CONSTANTS: Mapping[Enum, int] = {
    GraspAction.GRASP: 0,
    GraspAction.RELEASE: 1,
    GraspAction.TRANSFER: 2,
    GraspStatus.SUCCEEDED: 0,
    GraspStatus.MISSED: 1,
    GraspStatus.REJECTED: 2,
    IkStatus.CONVERGED: 0,
    IkStatus.STALLED: 1,
    IkStatus.ITERATION_LIMIT: 2,
    PhaseState.ACTIVE: 0,
    PhaseState.FAILED: 1,
    PlanStatus.SOLVED: 0,
    PlanStatus.ITERATION_LIMIT: 1,
    PlanStatus.INFEASIBLE: 2,
    PlanStatus.BRAKING: 3,
    Severity.INFO: 0,
    Severity.WARNING: 1,
    Severity.ERROR: 2,
}
_MEMBERS = {(type(member), number): member for member, number in CONSTANTS.items()}


def member_of(kind: type[E], number: int) -> E:
    """Return the member of an enum that a number in a message stands for; raises KeyError."""
    member = _MEMBERS[kind, number]
    assert isinstance(member, kind)
    return member
