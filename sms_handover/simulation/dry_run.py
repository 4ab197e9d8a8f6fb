"""Dry run: a scenario in one process before it is run, to see whether its bodies collide."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from sms_handover.errors import CollisionError
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.parameters import ONLINE, TRUE
from sms_handover.simulation.scenario import Scenario
from sms_handover.types import Collision, TaskPhase
from sms_handover.units import ns_to_seconds

Progress = Callable[[int, TaskPhase], None]


@dataclass(frozen=True)
class DryRun:
    """The collisions of a dry run, each of a group of bodies in a reference period, in the order of time."""

    collisions: tuple[Collision, ...]

    @property
    def worst(self) -> Collision | None:
        """The collision that is deepest beyond what is allowed, None if there is none."""
        return min(self.collisions, key=lambda item: item.distance - item.allowed, default=None)

    def __str__(self) -> str:
        """Return in one line between which bodies, when and how deep they collide; '' if they do not."""
        if self.worst is None:
            return ""
        since_s = ns_to_seconds(self.collisions[0].stamp_ns)
        return f"bodies collide from {since_s:.2f} s on, at worst {self.worst}"

    def require_clear(self) -> None:
        """Raise CollisionError if bodies collide."""
        if self.collisions:
            raise CollisionError(f"{self}; change the schedule, or run it without --reject-collisions")


def dry_run(scenario: Scenario, progress: Progress | None = None) -> DryRun:
    """Return the collisions of a scenario under its own law and dynamics, as far as the model knows.

    In lock step these are those of the run, bit for bit, unless truth and model differ; how far they do,
    nobody knows before a run. They are measured each reference period, so that bodies which touch between two
    of them alone go unseen. ``progress`` is called each period with the time in ns and the phase. Raises what
    :class:`~sms_handover.simulation.loop.Loop` does.
    """
    parameters = scenario.parameters
    common = replace(parameters.common, clearance=ONLINE, source=TRUE)  # the model has no sensors
    known = replace(scenario, parameters=replace(parameters, common=common), truth=scenario.model)
    loop = Loop(known)
    found: list[Collision] = []
    while not loop.finished:
        period = loop.advance_period().period
        if period and period.clearance:
            found.extend(period.clearance.collisions)
            if progress:
                progress(period.phase.stamp_ns, period.phase)
    return DryRun(tuple(found))
