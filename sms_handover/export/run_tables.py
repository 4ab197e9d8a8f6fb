"""A recorded run as tables: ticks, references, grasp events and what the nodes have decided."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sms_handover.export.selection import Wanted
from sms_handover.export.table import FLOAT, INTEGER, TEXT, Column
from sms_handover.run_data import Array, RunData, Stamps

_AXES, _TURN = ("x", "y", "z"), ("x", "y", "z", "w")


@dataclass(frozen=True)
class RunTable:
    """One table of a run; ``values`` has an array or list per column."""

    name: str
    columns: tuple[Column, ...]
    values: tuple[Any, ...]

    def rows(self, size: int) -> Iterator[list[tuple[Any, ...]]]:
        """Yield the rows in batches of at most ``size``."""
        for begin in range(0, len(self.values[0]), size):
            parts = [column[begin : begin + size] for column in self.values]
            plain = [part.tolist() if isinstance(part, np.ndarray) else part for part in parts]
            yield list(zip(*plain, strict=True))


def run_tables(run: RunData, wanted: Wanted) -> tuple[RunTable, ...]:
    """Return the tables of a run, of the rows whose stamps are ``wanted`` (a mask)."""
    return _ticks(run, wanted), _references(run, wanted), _events(run, wanted), _run_events(run, wanted)


class _Columns:
    """Columns as they are added, each cut to the rows wanted."""

    def __init__(self, stamps: Stamps, wanted: Wanted) -> None:
        self._mask = wanted(stamps)
        self.columns = [Column("stamp_ns", INTEGER, "ns")]
        self.values: list[Any] = [stamps[self._mask]]

    def add(self, name: str, unit: str, values: Any, kind: str = FLOAT) -> None:
        """Add one column."""
        self.columns.append(Column(name, kind, unit))
        self.values.append(np.asarray(values)[self._mask])

    def add_texts(self, name: str, values: Sequence[str]) -> None:
        """Add one column of texts."""
        self.columns.append(Column(name, TEXT))
        self.values.append([value for value, kept in zip(values, self._mask, strict=True) if kept])

    def add_all(self, names: Sequence[str], unit: str, values: Array) -> None:
        """Add the columns of an array."""
        for place, name in enumerate(names):
            self.add(name, unit, values[:, place])

    def add_pose(self, name: str, values: Array) -> None:
        """Add a pose."""
        self.add_all([f"{name}.position.{axis}" for axis in _AXES], "m", values[:, :3])
        self.add_all([f"{name}.orientation.{axis}" for axis in _TURN], "1", values[:, 3:])

    def table(self, name: str) -> RunTable:
        """Return what has been added."""
        return RunTable(name, tuple(self.columns), tuple(self.values))


def _ticks(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per tick: state, effort and command of every joint, pose and twist of the base."""
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
    return columns.table("ticks")


def _references(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per reference period: reference, targets, tools, deputy, receipts and phase."""
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
    columns.add_all([f"linear_momentum.{axis}" for axis in _AXES], "kg m/s", run.linear_momentum)
    columns.add_all([f"angular_momentum.{axis}" for axis in _AXES], "kg m^2/s", run.angular_momentum)
    columns.add("kinetic_energy", "J", run.kinetic_energy)
    columns.add("work", "J", run.work)
    columns.add("ik_status", "", run.ik_status, INTEGER)
    phases = {phase.stamp_ns: phase for phase in run.phases}
    found = [phases.get(int(stamp_ns)) for stamp_ns in run.reference_ns]
    indexes = np.array([-1 if phase is None else phase.index for phase in found], dtype=np.int64)
    columns.add("phase.index", "", indexes, INTEGER)
    columns.add_texts("phase.name", ["" if phase is None else phase.name for phase in found])
    return columns.table("references")


def _events(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per grasp event."""
    events = run.grasp_events
    columns = _Columns(np.array([event.stamp_ns for event in events], dtype=np.int64), wanted)
    columns.add_texts("action", [event.command.action.value for event in events])
    columns.add_texts("arm", [event.command.arm for event in events])
    columns.add_texts("grasp_frame", [event.command.grasp_frame for event in events])
    columns.add_texts("from_arm", [event.command.from_arm for event in events])
    columns.add_texts("status", [event.status.value for event in events])
    for name, unit in (("position_error", "m"), ("angle_error", "rad"), ("relative_speed", "m/s")):
        columns.add(name, unit, np.array([getattr(event, name) for event in events], dtype=np.float64))
    columns.add_texts("detail", [event.detail for event in events])
    return columns.table("grasp_events")


def _run_events(run: RunData, wanted: Wanted) -> RunTable:
    """Return a row per decision of a node."""
    events = run.run_events
    columns = _Columns(np.array([event.stamp_ns for event in events], dtype=np.int64), wanted)
    for name in ("node", "kind", "phase", "detail", "unit"):
        columns.add_texts(name, [getattr(event, name) for event in events])
    columns.add_texts("severity", [event.severity.value for event in events])
    for name in ("value", "limit"):
        columns.add(name, "", np.array([getattr(event, name) for event in events], dtype=np.float64))
    return columns.table("run_events")
