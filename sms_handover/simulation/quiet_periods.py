"""Quiet periods: reference periods in which nothing has to be decided, carried out together."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sms_handover.compiled.periods import CompiledPeriods, Room
from sms_handover.control.protocol import Guidance
from sms_handover.graph.events import RunEvent
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.trajectory.generator import TrajectoryGenerator
from sms_handover.types import JointReference, PeriodRows, Pose, TaskPhase, TickRows


@dataclass(frozen=True, eq=False)
class QuietPeriods:
    """Periods without an event, as arrays: ticks, what each period began with, and its phase.

    ``excesses`` tells, by the number of the tick, of limits of the joints that were exceeded; ``guidance``
    has the last two, or the only one: an acceleration is the difference of two.
    """

    rows: TickRows
    excesses: Mapping[int, tuple[RunEvent, ...]]
    guidance: tuple[Guidance, ...]
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

    def run(self, guidance: Guidance, last_tick: int, room: Room | None = None) -> QuietPeriods | None:
        """Carry out the quiet periods from here on, after one with ``guidance``, None if there are none.

        All their ticks are before ``last_tick``. No decision is due in them.
        The rows are written to ``room``, by default to a new array.
        """
        plant, generator, per_period = self._plant, self._generator, self._per_period
        first, stamp_ns = plant.tick, plant.stamp_ns
        deputy = plant.deputy_body
        if not (deputy.holder or deputy.rests):
            return None  # it drifts, and C does not move it
        until_ns = generator.quiet_until(stamp_ns)
        if until_ns is None:
            return None
        before = guidance.reference
        period_ns = stamp_ns - before.stamp_ns
        count = min((until_ns - stamp_ns) // period_ns, (last_tick - first) // per_period)
        if count < 1:
            return None
        course = generator.course(stamp_ns, period_ns, count)
        failures = generator.ik_failures
        rows, periods, failed = self._periods.run(course, before, stamp_ns, deputy, failures, room)
        last, deputy_row = int(periods.stamp_ns[-1]), periods.deputy_pose[-1]
        generator.went_quietly(last, Pose(deputy_row[:3], deputy_row[3:]), failed)
        phases = tuple(_at(course.phase, stamp) for stamp in periods.stamp_ns.tolist())
        latest = range(max(0, len(phases) - 2), len(phases))
        excesses = plant.take_excesses_of(first, rows)
        told = tuple(_guidance(phases[index], periods, index) for index in latest)
        return QuietPeriods(rows, excesses, told, periods, phases)


def _at(phase: TaskPhase, stamp_ns: int) -> TaskPhase:
    """Return a phase at another time."""
    return TaskPhase(stamp_ns, phase.index, phase.name, (), phase.state, phase.attempt, phase.end_ns)


def _guidance(phase: TaskPhase, periods: PeriodRows, index: int) -> Guidance:
    """Return the guidance of one of some periods."""
    position, velocity = periods.reference_position[index], periods.reference_velocity[index]
    reference = JointReference(phase.stamp_ns, np.array(position), np.array(velocity))
    return Guidance(phase, reference, {})
