"""Tables of a recorded run: ticks, references, grasp events and run events."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from sms_handover.export.selection import Wanted
from sms_handover.export.table import FLOAT, INTEGER, TEXT, Column
from sms_handover.run_data import Array, RunData, Stamps

_AXES, _QUATERNION = ("x", "y", "z"), ("x", "y", "z", "w")

_DTYPES: dict[str, Any] = {INTEGER: np.int64, FLOAT: np.float64, TEXT: object}


@dataclass(frozen=True)
class RunTable:
    """One table of a run; ``values`` has an array per column."""

    name: str
    columns: tuple[Column, ...]
    values: tuple[Any, ...]

    def rows(self, size: int) -> Iterator[list[tuple[Any, ...]]]:
        """Yield the rows in batches of at most ``size``."""
        for begin in range(0, len(self.values[0]), size):
            yield list(zip(*(column[begin : begin + size].tolist() for column in self.values), strict=True))


def run_tables(run: RunData, wanted: Wanted) -> tuple[RunTable, ...]:
    """Return the tables of a run, with the rows whose stamps are ``wanted``."""
    return _ticks(run, wanted), _references(run, wanted), _events(run, wanted), _run_events(run, wanted)


class _Columns:
    """Columns of one table, restricted to the wanted rows."""

    def __init__(self, stamps: Stamps, wanted: Wanted) -> None:
        self._mask = wanted(stamps)
        self.columns = [Column("stamp_ns", INTEGER, "ns")]
        self.values: list[Any] = [stamps[self._mask]]

    def add(self, name: str, unit: str, values: Any, kind: str = FLOAT) -> None:
        """Add one column."""
        self.columns.append(Column(name, kind, unit))
        self.values.append(np.asarray(values, dtype=_DTYPES[kind])[self._mask])

    def add_attributes(self, items: Sequence[Any], *paths: str, unit: str = "", kind: str = TEXT) -> None:
        """Add a column per attribute of the items, named as the last part of its path."""
        for path in paths:
            self.add(path.rpartition(".")[2], unit, list(map(attrgetter(path), items)), kind)

    def add_all(self, names: Sequence[str], unit: str, values: Array) -> None:
        """Add a column per column of an array."""
        for place, name in enumerate(names):
            self.add(name, unit, values[:, place])

    def add_pose(self, name: str, values: Array) -> None:
        """Add a pose."""
        self.add_all([f"{name}.position.{axis}" for axis in _AXES], "m", values[:, :3])
        self.add_all([f"{name}.orientation.{axis}" for axis in _QUATERNION], "1", values[:, 3:])

    def table(self, name: str) -> RunTable:
        """Return the table."""
        return RunTable(name, tuple(self.columns), tuple(self.values))


def _ticks(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per tick: joint states and commands, pose and twist of the base."""
    columns = _Columns(run.tick_ns, wanted)
    for quantity, unit, values in (
        ("position", "rad", run.joint_position),
        ("velocity", "rad/s", run.joint_velocity),
        ("effort", "N m", run.joint_effort),
        ("command", "N m", run.joint_command),
    ):
        columns.add_all([f"{joint}.{quantity}" for joint in run.joint_names], unit, values)
    columns.add_pose("base", run.base_pose)
    columns.add_all([f"base.linear_velocity.{axis}" for axis in _AXES], "m/s", run.base_twist[:, :3])
    columns.add_all([f"base.angular_velocity.{axis}" for axis in _AXES], "rad/s", run.base_twist[:, 3:])
    if run.measured:
        for quantity, unit, values in (
            ("measured_position", "rad", run.measured.joint_position),
            ("measured_velocity", "rad/s", run.measured.joint_velocity),
        ):
            columns.add_all([f"{joint}.{quantity}" for joint in run.joint_names], unit, values)
        columns.add_pose("base.measured", run.measured.base_pose)
        rate = run.measured.base_twist[:, 3:]
        columns.add_all([f"base.measured_angular_velocity.{axis}" for axis in _AXES], "rad/s", rate)
    return columns.table("ticks")


def _references(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per reference period: references, targets, tools, deputy, conserved quantities, phase."""
    columns = _Columns(run.reference_ns, wanted)
    for quantity, unit, values in (
        ("reference_position", "rad", run.reference_position),
        ("reference_velocity", "rad/s", run.reference_velocity),
    ):
        columns.add_all([f"{joint}.{quantity}" for joint in run.joint_names], unit, values)
    for arm in run.arms:
        columns.add_pose(f"{arm}.target", run.target_pose[arm])
        columns.add_pose(f"{arm}.tool", run.tool_pose[arm])
    columns.add_pose("deputy", run.deputy_pose)
    if run.measured:
        columns.add_pose("deputy.measured", run.measured.deputy_pose)
    columns.add_all([f"deputy.linear_velocity.{axis}" for axis in _AXES], "m/s", run.deputy_twist[:, :3])
    columns.add_all([f"deputy.angular_velocity.{axis}" for axis in _AXES], "rad/s", run.deputy_twist[:, 3:])
    columns.add_all([f"linear_momentum.{axis}" for axis in _AXES], "kg m/s", run.linear_momentum)
    columns.add_all([f"angular_momentum.{axis}" for axis in _AXES], "kg m^2/s", run.angular_momentum)
    columns.add_all([f"linear_impulse.{axis}" for axis in _AXES], "N s", run.linear_impulse)
    columns.add_all([f"angular_impulse.{axis}" for axis in _AXES], "N m s", run.angular_impulse)
    columns.add("kinetic_energy", "J", run.kinetic_energy)
    for name, joules in (("work", run.work), ("external_work", run.external_work), ("lost", run.lost)):
        columns.add(name, "J", joules)
    if run.panel_names:
        columns.add("elastic_energy", "J", run.elastic_energy)
        columns.add_all([f"{panel}.position" for panel in run.panel_names], "rad", run.panel_position)
        columns.add_all([f"{panel}.velocity" for panel in run.panel_names], "rad/s", run.panel_velocity)
    columns.add("ik_status", "", run.ik_status, INTEGER)
    phases = {phase.stamp_ns: phase for phase in run.phases}
    found = [phases.get(int(stamp_ns)) for stamp_ns in run.reference_ns]
    columns.add("phase.index", "", [-1 if phase is None else phase.index for phase in found], INTEGER)
    columns.add("phase.name", "", ["" if phase is None else phase.name for phase in found], TEXT)
    return columns.table("references")


def _events(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per grasp event."""
    events = run.grasp_events
    columns = _Columns(_stamps(events), wanted)
    columns.add("action", "", [event.command.action.value for event in events], TEXT)
    columns.add_attributes(events, "command.arm", "command.grasp_frame", "command.from_arm")
    columns.add("status", "", [event.status.value for event in events], TEXT)
    for name, unit in (
        ("position_error", "m"),
        ("angle_error", "rad"),
        ("relative_speed", "m/s"),
        ("relative_rate", "rad/s"),
        ("energy_lost", "J"),
    ):
        columns.add_attributes(events, name, unit=unit, kind=FLOAT)
    for name, unit, rows in (
        ("impulse", "N s", [event.impulse[:3] for event in events]),
        ("angular_impulse", "N m s", [event.impulse[3:] for event in events]),
    ):
        columns.add_all([f"{name}.{axis}" for axis in _AXES], unit, np.array(rows).reshape(-1, 3))
    columns.add_attributes(events, "detail")
    return columns.table("grasp_events")


def _run_events(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per run event."""
    events = run.run_events
    columns = _Columns(_stamps(events), wanted)
    columns.add_attributes(events, "node", "kind", "phase", "detail", "unit")
    columns.add("severity", "", [event.severity.value for event in events], TEXT)
    columns.add_attributes(events, "value", "limit", kind=FLOAT)
    return columns.table("run_events")


def _stamps(events: Sequence[Any]) -> Stamps:
    """Return the stamps of events."""
    return np.array([event.stamp_ns for event in events], dtype=np.int64)
