"""Every figure of a comparison as one row of a long table, for a data frame or a CSV file."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.conservation import IkOutcomes, PhysicsResiduals
from sms_handover.analysis.loop_timing import LoopTiming
from sms_handover.analysis.metrics import PhaseMetrics, RunMetrics
from sms_handover.analysis.numbers import largest, lengths
from sms_handover.analysis.torque import JointTorque
from sms_handover.analysis.tracking import ToolTracking
from sms_handover.analysis.work import JointWork

T = TypeVar("T")
_Column = tuple[str, str, Callable[[T], float]]


class Record(NamedTuple):
    """One figure in SI units; ``phase`` and ``arm`` are '' where it is of the whole run, or of the robot.

    ``value`` is NaN where the figure is not defined.
    """

    run: str
    phase: str
    arm: str
    figure: str
    unit: str
    value: float


def records_of(comparison: Comparison) -> list[Record]:
    """Return all figures of a comparison, run by run, phase by phase; ``docs/metrics.md`` defines them.

    ``pandas.DataFrame(records_of(comparison))`` has the fields as its columns.
    """
    return [
        Record(name, *row)
        for name, metrics in comparison.runs.items()
        for row in _of_run(comparison, name, metrics)
    ]


_Row = tuple[str, str, str, str, float]


def _of_run(comparison: Comparison, name: str, metrics: RunMetrics) -> Iterator[_Row]:
    """Yield the rows of one run."""
    arms = metrics.run.arms
    for item in metrics.phases:
        phase = item.phase.name
        for arm in arms:
            yield from _rows(phase, arm, _TOOL, item.tools[arm])
            yield from _rows(phase, arm, _TORQUE, item.torque.of_arm(arm))
            yield from _rows(phase, arm, _WORK, item.work.of_arm(arm))
        yield from _rows(phase, "", _PHASE, item)
        yield from _rows(phase, "", _BASE, item.base)
        yield from _rows(phase, "", _DRIFT, comparison.drift[name][phase])
        yield from _rows(phase, "", _PHYSICS, item.physics)
        yield from _rows(phase, "", _IK, item.ik)
    for arm in arms:
        yield from _rows("", arm, _TORQUE, metrics.torque.of_arm(arm))
        yield from _rows("", arm, _WORK, metrics.work.of_arm(arm))
    yield from _rows("", "", _PHYSICS, metrics.physics)
    yield from _rows("", "", _IK, metrics.ik)
    if metrics.loop:
        yield from _rows("", "", _LOOP, metrics.loop)


def _rows(phase: str, arm: str, columns: Iterable[_Column[T]], item: T) -> Iterator[_Row]:
    """Yield a row per column."""
    for figure, unit, value in columns:
        yield phase, arm, figure, unit, float(value(item))


def _attributes(*columns: tuple[str, str]) -> tuple[_Column[Any], ...]:
    """Return columns that are attributes of those names."""
    return tuple((name, unit, lambda item, name=name: getattr(item, name)) for name, unit in columns)


_TOOL: tuple[_Column[ToolTracking], ...] = (
    *_attributes(
        ("step_length", "m"),
        ("band", "m"),
        ("overshoot", "m"),
        ("overshoot_ratio", "-"),
        ("settling_time", "s"),
        ("largest_error", "m"),
        ("steady_state_error", "m"),
        ("final_error", "m"),
        ("final_orientation_error", "rad"),
    ),
    ("orientation_step_angle", "rad", lambda tool: tool.orientation.step_angle),
    ("orientation_band", "rad", lambda tool: tool.orientation.band),
    ("orientation_overshoot", "rad", lambda tool: tool.orientation.overshoot),
    ("orientation_overshoot_ratio", "-", lambda tool: tool.orientation.overshoot_ratio),
    ("orientation_settling_time", "s", lambda tool: tool.orientation.settling_time),
    ("largest_orientation_error", "rad", lambda tool: tool.orientation.largest_error),
    ("steady_state_orientation_error", "rad", lambda tool: tool.orientation.steady_state_error),
)
_TORQUE: tuple[_Column[JointTorque], ...] = (
    ("peak_torque", "N m", lambda torque: largest(torque.peak)),
    ("rms_torque", "N m", lambda torque: float(lengths(torque.rms))),
    ("control_effort", "(N m)^2 s", lambda torque: float(torque.effort.sum())),
    ("saturated_ticks", "-", lambda torque: largest(torque.saturated_ticks)),
    ("ticks_at_peak", "-", lambda torque: largest(torque.ticks_at_peak)),
)
_WORK: tuple[_Column[JointWork], ...] = (
    ("net_work", "J", lambda work: float(work.net.sum())),
    ("absolute_work", "J", lambda work: float(work.absolute.sum())),
    ("peak_power", "W", lambda work: largest(work.peak_power)),
)
_PHASE: tuple[_Column[PhaseMetrics], ...] = _attributes(("settling_time", "s"))
_BASE: tuple[_Column[BaseMotion], ...] = _attributes(
    ("position_change", "m"), ("attitude_change", "rad"), ("mean_speed", "m/s"), ("mean_turn_rate", "rad/s")
)
_DRIFT: tuple[_Column[BaseMotion], ...] = (
    ("drift_begin", "s", lambda drift: drift.begin),
    ("drift_duration", "s", lambda drift: drift.duration),
    ("drift_position_change", "m", lambda drift: drift.position_change),
    ("drift_attitude_change", "rad", lambda drift: drift.attitude_change),
    ("drift_position_rate", "m/s", lambda drift: drift.position_rate),
    ("drift_attitude_rate", "rad/s", lambda drift: drift.attitude_rate),
)
_PHYSICS: tuple[_Column[PhysicsResiduals], ...] = (
    ("largest_linear_momentum", "kg m/s", lambda physics: physics.linear_momentum),
    ("largest_angular_momentum", "kg m^2/s", lambda physics: physics.angular_momentum),
    ("energy_residual", "-", lambda physics: physics.energy),
    ("peak_kinetic_energy", "J", lambda physics: physics.peak_kinetic_energy),
)
_IK: tuple[_Column[IkOutcomes], ...] = (
    ("ik_solves", "-", lambda ik: ik.solves),
    ("ik_failures", "-", lambda ik: ik.failures),
    ("ik_stalled", "-", lambda ik: ik.stalled),
    ("ik_iteration_limit", "-", lambda ik: ik.iteration_limit),
)
_LOOP: tuple[_Column[LoopTiming], ...] = _attributes(
    ("wall_duration", "s"),
    ("real_time_factor", "-"),
    ("largest_lag", "s"),
    ("period_median", "s"),
    ("period_tail", "s"),
    ("period_mean", "s"),
    ("period_std", "s"),
    ("period_max", "s"),
    ("late_ticks", "-"),
    ("held_commands", "-"),
)
