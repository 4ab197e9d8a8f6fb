"""Problem of a plan: all that a solve depends on besides parameters, so that it can be solved elsewhere."""

from dataclasses import dataclass

from sms_handover.control.mpc.plan import Plan
from sms_handover.control.mpc.planner import PlanStart, Step
from sms_handover.model.known_payload import Grip
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array, freeze

_SHOWN_EVERY = 5  # [-] plans: ten times a second with shipped parameters, which viewers keep up with


@dataclass(frozen=True, eq=False)
class PlanProblem:
    """The plan ``number`` that begins at ``begin_ns``, posed at ``stamp_ns`` in a phase of the task.

    ``accelerations`` (N, n) rad/s^2 over ``intervals`` (N,) s are those to begin with, ``targets`` those of
    all instants but the first, ``initial_rotation`` (3, 3) is the attitude that the base is to keep.
    """

    number: int
    stamp_ns: int
    begin_ns: int
    phase_index: int
    grip: Grip
    initial_rotation: Array
    start: PlanStart
    accelerations: Array
    intervals: Array
    targets: tuple[PreviewedTargets, ...]

    def __post_init__(self) -> None:
        freeze(self, "initial_rotation", "accelerations", "intervals")

    @property
    def is_shown(self) -> bool:
        """Whether the paths of the tools are asked for too."""
        return self.number % _SHOWN_EVERY == 1

    def plan(self, step: Step) -> Plan:
        """Return the plan that a step gives whose program has been solved."""
        changed = self.accelerations + step.solution.change.reshape(self.accelerations.shape)
        return Plan(self.number, self.begin_ns, self.start.q, self.start.w, changed, self.intervals)
