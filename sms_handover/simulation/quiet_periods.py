"""Quiet periods: reference periods in which nothing has to be decided, carried out together."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sms_handover.compiled.periods import CompiledPeriods
from sms_handover.control.protocol import Guidance
from sms_handover.graph.events import RunEvent
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.trajectory.generator import TrajectoryGenerator
from sms_handover.types import JointReference, PeriodRows, TaskPhase, TickRows


@dataclass(frozen=True, eq=False)
class QuietPeriods:
    """Periods without an event, as arrays: ticks, what each period began with, and its phase.

    ``excesses`` tells, by the number of the tick, of limits of the joints that were exceeded; ``guidance`` is
    the last one.
    """

    rows: TickRows
    excesses: Mapping[int, tuple[RunEvent, ...]]
    guidance: Guidance
    periods: PeriodRows
    phases: tuple[TaskPhase, ...]


class QuietRunner:
    """Carries out quiet periods of a plant that a generator leads."""

    def __init__(
        self,
        plant: FreeFloatingPlant,
        generator: TrajectoryGenerator,
        periods: CompiledPeriods,
        per_period: int,
    ) -> None:
        """Use plant and generator of a loop; a period has ``per_period`` ticks."""
        self._plant, self._generator = plant, generator
        self._periods, self._per_period = periods, per_period

    def run(self, guidance: Guidance, last_tick: int) -> QuietPeriods | None:
        """Carry out the quiet periods from here on, after one with ``guidance``, None if there are none.

        All their ticks are before ``last_tick``. The targets stand still, the rates of the reference are
        those of the period before, and no decision is due.
        """
        plant, generator, per_period = self._plant, self._generator, self._per_period
        first, stamp_ns = plant.tick, plant.stamp_ns
        until_ns = generator.quiet_until(stamp_ns, deputy_rests=plant.held_or_resting.rests)
        if until_ns is None:
            return None
        before = guidance.reference
        period_ns = stamp_ns - before.stamp_ns
        count = min((until_ns - stamp_ns) // period_ns, (last_tick - first) // per_period)
        if count < 1:
            return None
        state = plant.state
        phase, targets = generator.targets(state, plant.deputy.deputy_in_world)
        if targets.joint_velocity.tobytes() != before.velocity.tobytes():
            return None
        deputy, losses = plant.held_or_resting, plant.losses
        rows, periods, failures = self._periods.run(count, targets, deputy, generator.ik_failures)
        generator.failed_so_far(failures)
        work: PeriodRows = replace(periods, work=periods.work - losses)
        phases = tuple(_at(phase, stamp) for stamp in work.stamp_ns.tolist())
        last = JointReference(phases[-1].stamp_ns, np.array(work.reference_position[-1]), before.velocity)
        excesses = plant.take_excesses_of(first, rows)
        return QuietPeriods(rows, excesses, Guidance(phases[-1], last, {}), work, phases)


def _at(phase: TaskPhase, stamp_ns: int) -> TaskPhase:
    """Return a phase at another time."""
    return TaskPhase(stamp_ns, phase.index, phase.name, (), phase.state, phase.attempt, phase.end_ns)
