"""Records: every figure of a comparison as one row of a long table, for a data frame or a CSV file."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from sms_handover.analysis.comparison import Comparison
from sms_handover.analysis.definitions import CLEARANCE
from sms_handover.analysis.joint_limits import LimitUse
from sms_handover.analysis.metrics import PhaseMetrics, RunMetrics
from sms_handover.analysis.numbers import largest, lengths
from sms_handover.analysis.orientation import OrientationTracking
from sms_handover.analysis.torque import JointTorque
from sms_handover.analysis.work import JointWork

T = TypeVar("T")
_Column = tuple[str, str, Callable[[T], float]]
_Row = tuple[str, str, str, str, float]


class Record(NamedTuple):
    """One figure in SI units; ``phase`` is '' for the whole run, ``arm`` is '' for the whole robot.

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


def figures_of(phases: Iterable[str], arms: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Yield phase, arm and name of each figure that a run of these phases and arms can have.

    Left out are the clearance of single groups of bodies, and what is measured in wall time.
    """
    for phase in phases:
        for arm in arms:
            yield from _named(phase, arm, _TOOL, _ORIENTATION, _TORQUE, _WORK)
        yield from _named(phase, "", _PHASE, _BASE, _DRIFT, _PHYSICS, _IK)
    for arm in arms:
        yield from _named("", arm, _TORQUE, _WORK)
    plans = tuple(column for column in _PLANS if column[0] not in WALL_TIMES)
    yield from _named("", "", _PHYSICS, _IK, _LIMITS, plans)


def _named(phase: str, arm: str, *tables: Iterable[_Column[Any]]) -> Iterator[tuple[str, str, str]]:
    for columns in tables:
        yield from ((phase, arm, figure) for figure, _, _ in columns)


def _of_run(comparison: Comparison, name: str, metrics: RunMetrics) -> Iterator[_Row]:
    for item in metrics.phases:
        phase = item.phase.name
        for arm in metrics.run.arms:
            yield from _rows(phase, arm, _TOOL, item.tools[arm])
            yield from _rows(phase, arm, _ORIENTATION, item.tools[arm].orientation)
            yield from _of_joints(phase, arm, item)
        yield from _rows(phase, "", _PHASE, item)
        yield from _rows(phase, "", _BASE, item.base)
        yield from _rows(phase, "", _DRIFT, comparison.drift[name][phase])
        yield from _conserved(phase, item)
    for arm in metrics.run.arms:
        yield from _of_joints("", arm, metrics)
    yield from _conserved("", metrics)
    if metrics.clearance:
        for group in metrics.clearance.groups:
            yield "", "", CLEARANCE.replace("GROUP", group.group), "m", group.least
    if metrics.limits:
        yield from _rows("", "", _LIMITS, metrics.limits)
    if metrics.plans:
        yield from _rows("", "", _PLANS, metrics.plans)
    if metrics.loop:
        yield from _rows("", "", _LOOP, metrics.loop)


def _of_joints(phase: str, arm: str, item: PhaseMetrics | RunMetrics) -> Iterator[_Row]:
    yield from _rows(phase, arm, _TORQUE, item.torque.of_arm(arm))
    yield from _rows(phase, arm, _WORK, item.work.of_arm(arm))


def _conserved(phase: str, item: PhaseMetrics | RunMetrics) -> Iterator[_Row]:
    yield from _rows(phase, "", _PHYSICS, item.physics)
    yield from _rows(phase, "", _IK, item.ik)


def _rows(phase: str, arm: str, columns: Iterable[_Column[T]], item: T) -> Iterator[_Row]:
    for figure, unit, value in columns:
        yield phase, arm, figure, unit, float(value(item))


def _attributes(figure: str = "{}", **units: str) -> tuple[_Column[Any], ...]:
    """Return a column per attribute and its unit; ``figure`` makes the figure's name from the attribute's."""
    return tuple((figure.format(name), unit, attrgetter(name)) for name, unit in units.items())


_TOOL = _attributes(
    step_length="m",
    band="m",
    overshoot="m",
    overshoot_ratio="-",
    settling_time="s",
    largest_error="m",
    steady_state_error="m",
    final_error="m",
    final_orientation_error="rad",
)
_ORIENTATION: tuple[_Column[OrientationTracking], ...] = (
    *_attributes(
        "orientation_{}",
        step_angle="rad",
        band="rad",
        overshoot="rad",
        overshoot_ratio="-",
        settling_time="s",
    ),
    ("largest_orientation_error", "rad", attrgetter("largest_error")),
    ("steady_state_orientation_error", "rad", attrgetter("steady_state_error")),
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
_PHASE = _attributes(settling_time="s")
_BASE = _attributes(position_change="m", attitude_change="rad", mean_speed="m/s", mean_turn_rate="rad/s")
_DRIFT = _attributes(
    "drift_{}",
    begin="s",
    duration="s",
    position_change="m",
    attitude_change="rad",
    position_rate="m/s",
    attitude_rate="rad/s",
)
_PHYSICS = (
    *_attributes("largest_{}", linear_momentum="kg m/s", angular_momentum="kg m^2/s"),
    *_attributes("{}_residual", energy="-"),
    *_attributes(peak_kinetic_energy="J", external_work="J"),
    *_attributes("energy_{}", lost="J"),
)
_LIMITS: tuple[_Column[LimitUse], ...] = (
    ("largest_rate_share", "-", lambda limits: limits.rate.value),
    ("time_above_rate_limit", "s", lambda limits: limits.rate.beyond),
    ("farthest_beyond_position_limit", "rad", lambda limits: limits.position.value),
    ("time_beyond_position_limit", "s", lambda limits: limits.position.beyond),
)
_SOLVE_TIMES = {"solve_median": "s", "solve_tail": "s", "solve_max": "s", "program_median": "s"}
_PLANS = _attributes(
    solves="-",
    failed_solves="-",
    reused_plans="-",
    late_plans="-",
    binding_share="-",
    **_SOLVE_TIMES,
)
_IK = _attributes("ik_{}", solves="-", failures="-", stalled="-", iteration_limit="-")
_LOOP = _attributes(
    wall_duration="s",
    real_time_factor="-",
    largest_lag="s",
    period_median="s",
    period_tail="s",
    period_mean="s",
    period_std="s",
    period_max="s",
    late_ticks="-",
    held_commands="-",
)
WALL_TIMES = frozenset([*_SOLVE_TIMES, *(figure for figure, _, _ in _LOOP)])  # differ from run to run
_OF_PHASES: tuple[_Column[Any], ...] = (*_TOOL, *_ORIENTATION, *_TORQUE, *_WORK, *_PHASE, *_BASE, *_DRIFT)
_OF_RUNS: tuple[_Column[Any], ...] = (*_PHYSICS, *_IK, *_LIMITS, *_PLANS, *_LOOP)
UNITS: Mapping[str, str] = MappingProxyType(
    {
        **{figure: unit for figure, unit, _ in (*_OF_PHASES, *_OF_RUNS)},
        CLEARANCE: "m",
    }
)
