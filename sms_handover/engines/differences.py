"""Differences between a recorded run and the motion of a second engine: the largest of each quantity."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sms_handover.analysis.numbers import angle_between, complete, lengths
from sms_handover.engines.bounds import Bounds
from sms_handover.engines.protocol import Motion
from sms_handover.engines.recording import compared_periods, grasps
from sms_handover.run_data import RunData, Stamps
from sms_handover.types import BASE_NQ, Array
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True)
class Difference:
    """The largest difference of a quantity over a run, when it was, in s, and what it may be at most."""

    quantity: str
    largest: float
    unit: str
    time: float
    bound: float

    @property
    def within(self) -> bool:
        """Whether it is within its bound; NaN is not."""
        return self.largest <= self.bound


class _Compared(NamedTuple):
    """A quantity: rows of engine and run in pairs, their times, and how far two rows are apart."""

    quantity: str
    unit: str
    bound: float
    apart: Callable[[Array, Array], Array]
    stamp_ns: Stamps
    pairs: list[tuple[Array, Array]]


def differences(run: RunData, motion: Motion, bounds: Bounds) -> tuple[Difference, ...]:
    """Return the largest difference of each quantity, where it was recorded."""
    found = []
    for item in _compared(run, motion, bounds):
        recorded = np.flatnonzero(np.all([complete(theirs) for _, theirs in item.pairs], axis=0))
        if recorded.size:
            rows = [item.apart(ours[recorded], theirs[recorded]) for ours, theirs in item.pairs]
            values = np.max(rows, axis=0)
            place = int(np.argmax(values))  # that of a NaN, if the engine diverged
            time = ns_to_seconds(int(item.stamp_ns[recorded[place]]))
            found.append(Difference(item.quantity, float(values[place]), item.unit, time, item.bound))
    return tuple(found)


def _compared(run: RunData, motion: Motion, bounds: Bounds) -> Iterator[_Compared]:
    """Yield the quantities in the order in which they are told."""
    periods = compared_periods(run)
    times = run.reference_ns[periods]
    ticks = np.searchsorted(run.tick_ns, times)
    joints = motion.q[:, BASE_NQ:], run.joint_position[ticks]
    yield _Compared("joints", "rad", bounds.joints, _largest, times, [joints])
    base = motion.q[:, :BASE_NQ], run.base_pose[ticks]
    yield from _poses("base", [base], times, bounds.base_position, bounds.base_attitude)
    tools = [(motion.tools[arm], run.tool_pose[arm][periods]) for arm in run.arms]
    yield from _poses("tool", tools, times, bounds.tool_position, bounds.tool_attitude)
    for name, unit, bound, ours, theirs in (
        ("linear", "kg m/s", bounds.linear_momentum, motion.linear_momentum, run.linear_momentum),
        ("angular", "kg m^2/s", bounds.angular_momentum, motion.angular_momentum, run.angular_momentum),
    ):
        yield _Compared(f"{name} momentum", unit, bound, _distances, times, [(ours, theirs[periods])])
    if motion.deputy.size:
        deputy = motion.deputy, run.deputy_pose[periods]
        yield from _poses("deputy", [deputy], times, bounds.tool_position, bounds.tool_attitude)
    if motion.impulses.size:
        events = grasps(run)
        given = np.array([event.impulse for event in events])
        stamps = np.array([event.stamp_ns for event in events], dtype=np.int64)
        for name, unit, bound, part in (
            ("impulse", "N s", bounds.impulse, slice(3)),
            ("impulsive moment", "N m s", bounds.impulse, slice(3, 6)),
        ):
            pair = motion.impulses[:, part], given[:, part]
            yield _Compared(name, unit, bound, _distances, stamps, [pair])


def _poses(
    name: str, pairs: list[tuple[Array, Array]], times: Stamps, position: float, attitude: float
) -> Iterator[_Compared]:
    """Yield position and attitude of poses (K, 7)."""
    places = [(ours[:, :3], theirs[:, :3]) for ours, theirs in pairs]
    yield _Compared(f"{name} position", "m", position, _distances, times, places)
    turns = [(ours[:, 3:], theirs[:, 3:]) for ours, theirs in pairs]
    yield _Compared(f"{name} attitude", "rad", attitude, angle_between, times, turns)


def _largest(a: Array, b: Array) -> Array:
    return np.asarray(np.max(np.abs(a - b), axis=1))


def _distances(a: Array, b: Array) -> Array:
    return lengths(a - b)
