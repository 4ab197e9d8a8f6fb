"""Equality of two runs, bit for bit."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sms_handover.configuration.conditions_fields import SENSORS
from sms_handover.graph.events import MESSAGE_REFUSED
from sms_handover.graph.topics import TRAJECTORY
from sms_handover.run_data import Array, MeasuredRows, RunData
from sms_handover.types import GraspEvent

_PER_TICK = (
    "tick_ns",
    "joint_position",
    "joint_velocity",
    "joint_effort",
    "joint_command",
    "base_pose",
    "base_twist",
)
_UNTIMED: Mapping[str, Any] = dict.fromkeys(("linearization_time", "program_time", "total_time"), 0.0)
_NUMBERS = (float, tuple[float, ...])  # the fields of a grasp event that can be unknown
_PER_JOINT = (
    *("joint_position", "joint_velocity", "joint_effort", "joint_command"),
    *("reference_position", "reference_velocity"),
)
_MEASURED = "measured"
_MEASURED_ROWS = tuple(item.name for item in fields(MeasuredRows))


@dataclass(frozen=True)
class Difference:
    """One field in which two runs differ: how many rows, the first of them, and the largest difference."""

    field: str
    detail: str

    def __str__(self) -> str:
        return f"{self.field}: {self.detail}"


def compare_runs(a: RunData, b: RunData) -> tuple[Difference, ...]:
    """Return the fields in which two runs differ; none if they are bit-identical (NaN equals NaN).

    The wall times of solves are left out. Of the run events only those of the trajectory are compared,
    because those of other nodes depend on wall time too. What sensors told is compared where both runs have
    it. Events of rejected messages are left out: they
    depend on what strangers sent.
    """
    return tuple(_differences(a, b))


def run_digest(run: RunData) -> str:
    """Return SHA-256 of all that :func:`compare_runs` compares but what sensors told, in hexadecimal."""
    digest = hashlib.sha256()
    for item in fields(RunData):
        if item.name == _MEASURED:
            continue
        value = _compared(run, item.name)
        if isinstance(value, Mapping):
            value = [(arm, value[arm].tobytes()) for arm in sorted(value)]
        parts = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
        digest.update(item.name.encode() + parts)
    return digest.hexdigest()


def before(run: RunData, end_ns: int) -> RunData:
    """Return the part of a run before ``end_ns``."""
    ticks, periods = run.tick_ns < end_ns, run.reference_ns < end_ns
    values: dict[str, Any] = {}
    for item in fields(RunData):
        value = getattr(run, item.name)
        if isinstance(value, np.ndarray):
            values[item.name] = value[ticks if item.name in _PER_TICK else periods]
        elif isinstance(value, Mapping):
            values[item.name] = {arm: rows[periods] for arm, rows in value.items()}
        elif item.name in ("joint_names", "arms", "panel_names", "applied"):
            values[item.name] = value
        elif isinstance(value, MeasuredRows):
            cut = {name: ticks if name in _PER_TICK else periods for name in _MEASURED_ROWS}
            values[item.name] = MeasuredRows(**{name: getattr(value, name)[cut[name]] for name in cut})
        elif value is None:
            values[item.name] = None
        else:
            values[item.name] = tuple(entry for entry in value if entry.stamp_ns < end_ns)
    return RunData(**values)


def as_far_as_recorded(recorded: RunData, again: RunData) -> tuple[RunData, tuple[str, ...]]:
    """Return a run computed again without what the recording of it has no number of, and what that is.

    An older version recorded less: nothing can be said of what is NaN throughout in its recording alone.
    """
    values: dict[str, Any] = {}
    missing = []
    for item in fields(RunData):
        theirs, ours = getattr(recorded, item.name), getattr(again, item.name)
        if isinstance(theirs, np.ndarray) and theirs.shape == ours.shape and _lacks([theirs], [ours]):
            values[item.name] = theirs
            missing.append(item.name)
    if again.applied and not recorded.applied:
        values["applied"] = ""
        missing.append("applied")
    elif again.applied:
        theirs, ours = (json.loads(run.applied) for run in (recorded, again))
        if SENSORS in ours and SENSORS not in theirs:
            del ours[SENSORS]
            values["applied"] = json.dumps(ours)
            missing.append(f"applied.{SENSORS}")
    events, lacking = recorded.grasp_events, {}
    for item in fields(GraspEvent):
        theirs, ours = ([getattr(e, item.name) for e in run.grasp_events] for run in (recorded, again))
        if events and item.type in _NUMBERS and _lacks(theirs, ours):
            lacking[item.name] = theirs[0]
            missing.append(f"grasp_events.{item.name}")
    values["grasp_events"] = tuple(replace(event, **lacking) for event in again.grasp_events)
    return replace(again, **values), tuple(missing)


def _lacks(theirs: Sequence[Any], ours: Sequence[Any]) -> bool:
    """Whether there are numbers of ours, and none of theirs."""
    empty, known = (not any(np.any(~np.isnan(value)) for value in values) for values in (theirs, ours))
    return empty and not known


def _differences(a: RunData, b: RunData) -> Iterator[Difference]:
    for item in fields(RunData):
        if item.name == _MEASURED:
            yield from _measured_differences(a, b)
            continue
        left, right = _compared(a, item.name), _compared(b, item.name)
        if isinstance(left, np.ndarray):
            yield from _compare(item.name, left, right)
        elif item.name in ("target_pose", "tool_pose"):
            for arm in sorted({*left, *right}):
                if arm in left and arm in right:
                    yield from _compare(f"{item.name}[{arm}]", left[arm], right[arm])
                else:
                    yield Difference(f"{item.name}[{arm}]", "only one of the runs has it")
        elif repr(left) != repr(right):
            yield Difference(item.name, _first_difference(left, right))


def _measured_differences(a: RunData, b: RunData) -> Iterator[Difference]:
    """Yield the differences in what sensors have told, where both runs know it.

    In one process compiled ticks do not measure where nobody listens.
    """
    if a.measured and b.measured:
        left, right = _measured_of(a, a.measured), _measured_of(b, b.measured)
        for name, rows in left.items():
            yield from _compare(f"{_MEASURED}.{name}", rows, right[name])


def _measured_of(run: RunData, measured: MeasuredRows) -> dict[str, Array]:
    """Return what sensors have told by its name, joints in the order of their names."""
    columns = sorted(range(len(run.joint_names)), key=run.joint_names.__getitem__)
    found = {name: getattr(measured, name) for name in _MEASURED_ROWS}
    return {name: rows[:, columns] if name in _PER_JOINT else rows for name, rows in found.items()}


def _compared(run: RunData, name: str) -> Any:
    """Return what of a field another run has to have too, joints and arms in the order of their names."""
    if name in ("joint_names", "arms"):
        return tuple(sorted(getattr(run, name)))
    if name in _PER_JOINT:
        columns = sorted(range(len(run.joint_names)), key=run.joint_names.__getitem__)
        return getattr(run, name)[:, columns]
    if name == "run_events":
        own = (event for event in run.run_events if event.node == TRAJECTORY)
        return tuple(event for event in own if event.kind != MESSAGE_REFUSED)
    if name == "plans":
        return tuple(replace(plan, **_UNTIMED) for plan in run.plans)
    if name == "planned_paths":
        # as numbers, whose repr has all digits
        return tuple(
            (paths.stamp_ns, {arm: path.tolist() for arm, path in paths.tool_in_world.items()})
            for paths in run.planned_paths
        )
    return getattr(run, name)


def _first_difference(left: tuple[object, ...], right: tuple[object, ...]) -> str:
    """Return the first difference of two tuples; they are compared by their repr, in which NaN equals NaN."""
    for index, (one, other) in enumerate(zip(left, right, strict=False)):
        if repr(one) != repr(other):
            return f"item {index} is {one!r} and {other!r}"
    return f"{len(left)} items and {len(right)} items"


def _compare(name: str, left: np.ndarray, right: np.ndarray) -> Iterator[Difference]:
    if left.shape != right.shape:
        yield Difference(name, f"shapes {left.shape} and {right.shape}")
        return
    kind = np.int64 if left.dtype == np.int64 else np.float64
    same = (left == right) | (np.isnan(left.astype(kind)) & np.isnan(right.astype(kind)))
    if not np.all(same):
        rows = np.unique(np.nonzero(~same)[0])
        sizes = np.abs(left - right)[~same]
        known = sizes[~np.isnan(sizes)]
        by = f"by {float(known.max()):.3g} at most" if known.size else "where only one run has numbers"
        yield Difference(name, f"{rows.size} of {left.shape[0]} rows, first row {rows[0]}, {by}")
