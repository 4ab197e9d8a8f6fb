"""Plots of the report: signals of all runs over time, decimated."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.analysis import signals
from sms_handover.analysis.decimation import decimate
from sms_handover.analysis.measurement_errors import measurement_errors
from sms_handover.analysis.numbers import lengths
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.signals import Signal
from sms_handover.run_data import RunData
from sms_handover.types import Array
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

TRANSIENT_S = 4.0  # [s] at the beginning of a phase that is drawn in more detail than the rest
POINTS = 600  # largest number of points of a line in each section: a transient or the rest of a phase


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a plot: ``time`` (N,) s and ``values`` (N,); run and series are given by index."""

    run: int
    series: int
    time: Array
    values: Array


@dataclass(frozen=True)
class Level:
    """A horizontal line at ``value`` across a plot, with what it means."""

    value: float
    text: str


@dataclass(frozen=True, eq=False)
class Plot:
    """One plot over time; ``series`` has the names of the lines of each run.

    ``lines`` is empty if no run recorded the signal. A plot of a ``magnitude`` may have a logarithmic
    scale, because no value is negative. The axis of values ends at the ``ceiling`` if there is one, and
    shows the ``levels``.
    """

    key: str
    title: str
    unit: str
    series: tuple[str, ...]
    lines: tuple[Line, ...]
    magnitude: bool
    levels: tuple[Level, ...] = ()
    ceiling: float | None = None


@dataclass(frozen=True)
class PlotGroup:
    """Plots under one heading, with a sentence about them."""

    title: str
    text: str
    plots: tuple[Plot, ...]


@dataclass(frozen=True)
class _Kind:
    """How to plot a signal: ``factor`` converts SI into ``unit``; ``magnitude`` plots the norm of a row."""

    key: str
    title: str
    factor: float
    unit: str
    magnitude: bool = False


_TOOL = (
    _Kind("position_error", "Position error of the tool of {arm}", MM_PER_M, "mm", magnitude=True),
    _Kind("orientation_error", "Orientation error of the tool of {arm}", DEG_PER_RAD, "deg", magnitude=True),
)
_JOINTS = (
    _Kind("joint_torque", "Joint torques of {arm}", 1.0, "N m"),
    _Kind("joint_error", "Joint errors of {arm}, actual minus desired", DEG_PER_RAD, "deg"),
)
_BASE = (
    _Kind("base_displacement", "Displacement of the base", MM_PER_M, "mm"),
    _Kind("base_rotation", "Rotation of the base, as a rotation vector", DEG_PER_RAD, "deg"),
    _Kind("base_speed", "Speed of the base", MM_PER_M, "mm/s", magnitude=True),
    _Kind("base_turn_rate", "Turn rate of the base", DEG_PER_RAD, "deg/s", magnitude=True),
)
_MOMENTA = (
    _Kind("linear_momentum", "Linear momentum", 1.0, "kg m/s", magnitude=True),
    _Kind("angular_momentum", "Angular momentum about the centre of mass", 1.0, "kg m²/s", magnitude=True),
)
_CHANGES = (  # by nothing from outside, other than the momenta themselves where a run begins with some
    _Kind("linear_momentum_change", "Change of the linear momentum", 1.0, "kg m/s", magnitude=True),
    _Kind("angular_momentum_change", "Change of the angular momentum", 1.0, "kg m²/s", magnitude=True),
)
_ENERGY = (
    _Kind("energy", "Kinetic energy, work of the torques, and heat", 1.0, "J"),
    _Kind("energy_residual", "Energy gained beyond the work done, less heat", 1.0, "J"),
)
_ENCODERS = (
    _Kind("encoder_error", "Angles of {arm} by the encoders, less the true ones", DEG_PER_RAD, "deg"),
    _Kind("rate_error", "Rates of {arm} by the encoders, less the true ones", DEG_PER_RAD, "deg/s"),
)
_OTHER_SENSORS = (
    _Kind("gyro_error", "Angular velocity of the base by the gyro, less the true one", DEG_PER_RAD, "deg/s"),
    _Kind("star_tracker_error", "Orientation of the base by the star tracker, off by", DEG_PER_RAD, "deg"),
    _Kind("vision_position_error", "Position of the deputy by vision, less the true one", MM_PER_M, "mm"),
    _Kind("vision_angle_error", "Orientation of the deputy by vision, off by", DEG_PER_RAD, "deg"),
)


def plot_groups(runs: Sequence[RunData]) -> tuple[PlotGroup, ...]:
    """Return all plots of the runs."""
    found = [{**signals.signals_of(run), **measurement_errors(run)} for run in runs]
    arms = tuple(dict.fromkeys(arm for run in runs for arm in run.arms))
    cuts = [cuts_of(run) for run in runs]
    with_changes = any(_departs(of_run, kind.key) for of_run in found for kind in _MOMENTA)

    def plots(kinds: Sequence[_Kind], names: Sequence[str]) -> tuple[Plot, ...]:
        return tuple(_plot(kind, name, found, cuts) for kind in kinds for name in names)

    sensed = PlotGroup(
        "Measurements",
        "What the sensors told of robot and deputy, less what was true, as the loop knew it at that time.",
        (*plots(_ENCODERS, arms), *plots(_OTHER_SENSORS, [""])),
    )
    return (
        PlotGroup(
            "Tools",
            "Distance and angle between each tool and its target. A step of the target shows as a jump.",
            plots(_TOOL, arms),
        ),
        PlotGroup(
            "Joints",
            "Torque of each joint, and its deviation from the reference.",
            plots(_JOINTS, arms),
        ),
        PlotGroup(
            "Base",
            "Motion of the free base: it reacts to every motion of an arm, and must come to rest.",
            plots(_BASE, [""]),
        ),
        PlotGroup(
            "Conservation",
            "Without forces from outside the momenta of robot and deputy together stay what they were at the "
            "start, also as the deputy changes hands, and kinetic energy is work less heat; the residuals "
            "are rounding errors.",
            plots((*_MOMENTA, *(_CHANGES if with_changes else ()), *_ENERGY), [""]),
        ),
        *([sensed] if any(run.measured for run in runs) else []),
    )


def _departs(signals_of_run: Mapping[str, Signal], momentum: str) -> bool:
    """Return whether a momentum is not its change: it begins with some, or is given some from outside."""
    now, change = (signals_of_run[key].values for key in (momentum, f"{momentum}_change"))
    return bool(np.any(np.nan_to_num(now - change)))


def _plot(
    kind: _Kind, arm: str, found: Sequence[Mapping[str, Signal]], cuts: Sequence[Sequence[float]]
) -> Plot:
    """Return the plot of one kind of signal, for an arm or for the robot."""
    key = f"{arm}/{kind.key}" if arm else kind.key
    series: tuple[str, ...] = ()
    lines: list[Line] = []
    for place, (signals_of_run, cuts_of_run) in enumerate(zip(found, cuts, strict=True)):
        signal = signals_of_run.get(key)
        if signal is None or np.all(np.isnan(signal.values)):
            continue
        labels = ("",) if kind.magnitude else tuple(_short(label, arm) for label in signal.labels)
        values = lengths(signal.values)[:, np.newaxis] if kind.magnitude else signal.values
        series = series or labels
        for column, label in enumerate(labels):
            if label in series:
                time, thinned = thin(signal.time, kind.factor * values[:, column], cuts_of_run)
                lines.append(Line(place, series.index(label), time, thinned))
    return Plot(key, kind.title.format(arm=arm), kind.unit, series, tuple(lines), kind.magnitude)


def thin(time: Array, values: Array, cuts: Sequence[float]) -> tuple[Array, Array]:
    """Return a series decimated per section between ``cuts`` (s), so that each keeps its shape."""
    edges = [0, *np.searchsorted(time, cuts).tolist(), len(time)]
    parts = [decimate(time[begin:end], values[begin:end], POINTS) for begin, end in itertools.pairwise(edges)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def cuts_of(run: RunData) -> list[float]:
    """Return the times in s at which a transient begins or ends."""
    cuts: list[float] = []
    for span in phase_spans(run):
        begin, end = ns_to_seconds(span.start_ns), ns_to_seconds(span.end_ns)
        cuts += [begin, min(begin + TRANSIENT_S, end)]
    return cuts


def _short(label: str, arm: str) -> str:
    """Return the name of a series without the arm, which the title has."""
    return label.removeprefix(f"{arm}_").replace("_", " ")
