"""Grasps of a run: who held the deputy, and within which tolerance."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from sms_handover.types import GraspAction, GraspEvent, GraspStatus


class Tolerance(Protocol):
    """Largest pose error and relative twist at which a grasp succeeds: m, rad, m/s, rad/s."""

    @property
    def position(self) -> float:
        """Distance in m."""

    @property
    def angle(self) -> float:
        """Angle in rad."""

    @property
    def speed(self) -> float:
        """Relative speed in m/s."""

    @property
    def rate(self) -> float:
        """Relative angular rate in rad/s; infinite where it was not judged."""


@dataclass(frozen=True)
class Hold:
    """``holder`` has the deputy from ``since_ns`` on, '' while it floats; ``giver`` had it before."""

    since_ns: int
    holder: str
    giver: str


def holds(events: Iterable[GraspEvent]) -> tuple[Hold, ...]:
    """Return every change of holder, in the order of time; only successful grasps and releases count."""
    changes: list[Hold] = []
    holder = ""
    for event in events:
        if event.status is not GraspStatus.SUCCEEDED:
            continue
        after = "" if event.command.action is GraspAction.RELEASE else event.command.arm
        changes.append(Hold(event.stamp_ns, after, holder))
        holder = after
    return tuple(changes)
