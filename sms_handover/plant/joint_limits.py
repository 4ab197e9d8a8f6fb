"""Watch over the joints' limits: every excess of a position or rate limit becomes an event."""

from dataclasses import dataclass

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.graph.events import POSITION_EXCEEDED, RATE_EXCEEDED, RunEvent, Severity
from sms_handover.graph.topics import PLANT
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds

REPORT, ENFORCE = "report", "enforce"
_BLOCK = 100  # [states] looked at together
_QUIET_NS = 100_000_000  # [ns] own choice: excesses of one limit that are less apart are one


@dataclass(frozen=True)
class Excess:
    """An excess of one limit: ``row`` is the joint for its position, and n plus the joint for its rate.

    ``value`` is the farthest position in rad or the fastest rate in rad/s, ``start_ns`` the stamp of the
    first state beyond the limit, ``end_ns`` the end of the tick that the latest one began, ``beyond_ns`` the
    time beyond the limit between them.
    """

    row: int
    value: float
    start_ns: int
    end_ns: int
    beyond_ns: int


class JointLimitWatch:
    """Looks at every state of a run, and tells of each excess once it is over, or when the run ends.

    An excess is over at the first look after its limit has been kept for 0.1 s, so that a joint that
    chatters about a limit makes one excess. States are looked at in blocks, for speed; what is told, and
    when, follows from the states alone.
    """

    def __init__(self, robot: RobotModel, tick_ns: int) -> None:
        self._robot, self._tick_ns = robot, tick_ns
        self._rate_limit = robot.pin.velocityLimit[BASE_NV:].copy()
        free_pose, free_twist = np.full(BASE_NQ, np.inf), np.full(BASE_NV, np.inf)
        self._upper = np.concatenate([free_pose, robot.upper, free_twist, self._rate_limit])
        self._lower = np.concatenate([-free_pose, robot.lower, -free_twist, -self._rate_limit])
        # q, v, q, v, ... of a block; those of the block before stay until they are replaced
        self._parts: list[Array] = [np.zeros(0)] * (2 * _BLOCK)
        self.reset()

    def reset(self) -> None:
        """Forget every state and excess."""
        self._count = 0  # of the parts that are still to be looked at
        self._excesses: dict[int, Excess] = {}

    def restore(self, excesses: tuple[Excess, ...]) -> None:
        """Go back to the excesses of a former state."""
        self.reset()
        self._excesses = {excess.row: excess for excess in excesses}

    def excesses(self, stamp_ns: int) -> tuple[Excess, ...]:
        """Return the excesses that are not over, before the state of a stamp is added."""
        self._look(stamp_ns - self._tick_ns)
        return tuple(self._excesses.values())

    def add(self, tick: int, q: Array, v: Array) -> tuple[RunEvent, ...]:
        """Add the state of a tick, one after the other, and return the excesses that are over."""
        count, parts = self._count, self._parts
        parts[count], parts[count + 1] = q, v
        self._count = count + 2
        if tick % _BLOCK:
            return ()
        stamp_ns = tick * self._tick_ns
        self._look(stamp_ns)
        return self._take([e for e in self._excesses.values() if stamp_ns - e.end_ns >= _QUIET_NS], stamp_ns)

    def add_rows(self, first: int, q: Array, v: Array) -> dict[int, tuple[RunEvent, ...]]:
        """Add the states (k, 7 + n) and (k, 6 + n) of ticks from ``first`` on; return what is over by row."""
        self._look((first - 1) * self._tick_ns)
        nq = q.shape[1]
        parts = ((q, slice(nq)), (v, slice(nq, None)))
        if not self._excesses and all(_kept(a, self._lower[at], self._upper[at]) for a, at in parts):
            return {}
        found = ((k, self.add(first + k, *state)) for k, state in enumerate(zip(q, v, strict=True)))
        return {k: events for k, events in found if events}

    def end(self, stamp_ns: int) -> tuple[RunEvent, ...]:
        """Return the excesses that are not over at the end of a run, whose last state has been added."""
        self._look(stamp_ns)
        return self._take(list(self._excesses.values()), stamp_ns)

    def _look(self, stamp_ns: int) -> None:
        """Look at the states added since the last look; the last of them has this stamp."""
        if not self._count:
            return
        states = np.concatenate(self._parts[: self._count]).reshape(-1, self._upper.size)
        self._count = 0
        beyond = (states > self._upper) | (states < self._lower)
        if not np.count_nonzero(beyond):
            return
        n = self._robot.n_joints
        for index, column in np.argwhere(beyond).tolist():
            row = column - BASE_NQ if column < BASE_NQ + n else column - BASE_NQ - BASE_NV
            at_ns = stamp_ns - (len(states) - 1 - index) * self._tick_ns
            self._note(at_ns, row, float(states[index, column]))

    def _note(self, stamp_ns: int, row: int, value: float) -> None:
        """Begin an excess, or go on with it."""
        tick_ns, before = self._tick_ns, self._excesses.get(row)
        if before is None:
            self._excesses[row] = Excess(row, value, stamp_ns, stamp_ns + tick_ns, tick_ns)
            return
        farthest = max(before.value, value, key=abs)
        self._excesses[row] = Excess(
            row, farthest, before.start_ns, stamp_ns + tick_ns, before.beyond_ns + tick_ns
        )

    def _take(self, over: list[Excess], stamp_ns: int) -> tuple[RunEvent, ...]:
        """Forget excesses that are over, and return their events."""
        for excess in over:
            del self._excesses[excess.row]
        return tuple(self._event(excess, stamp_ns) for excess in over)

    def _event(self, excess: Excess, stamp_ns: int) -> RunEvent:
        robot, value = self._robot, excess.value
        joint = excess.row % robot.n_joints
        if excess.row < robot.n_joints:
            kind, unit, what = POSITION_EXCEEDED, "rad", "was beyond a limit of its position"
            limit = float(robot.upper[joint] if value > robot.upper[joint] else robot.lower[joint])
        else:
            kind, unit, what = RATE_EXCEEDED, "rad/s", "turned faster than the limit of its rate"
            value, limit = abs(value), float(self._rate_limit[joint])
        start, end, beyond = map(ns_to_seconds, (excess.start_ns, excess.end_ns, excess.beyond_ns))
        detail = f"{robot.joint_names[joint]} {what} for {beyond:g} s, from {start:g} to {end:g} s"
        return RunEvent(stamp_ns, PLANT, kind, Severity.WARNING, detail, "", value, limit, unit)


def require_start_within_limits(robot: RobotModel, start: Array) -> None:
    """Raise ConfigurationError where a joint starts outside its limits."""
    for name, value, low, high in zip(robot.joint_names, start, robot.lower, robot.upper, strict=True):
        if not low <= value <= high:
            raise ConfigurationError(
                f"initial position of {name} is {value} rad, must be in [{low}, {high}] rad"
            )


def _kept(rows: Array, lower: Array, upper: Array) -> bool:
    """Whether no number is beyond its limit; one that is no number is not."""
    return not (np.count_nonzero(rows > upper) or np.count_nonzero(rows < lower))
