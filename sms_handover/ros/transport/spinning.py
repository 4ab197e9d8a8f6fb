"""Spinning: a loop looks for what it awaits for a moment before it sleeps, as to be woken takes longer.

A sleeping thread is woken by another processor in tens of microseconds, and the loop of plant and controller
is two such wake-ups per tick. Who spins gives the processor to whoever else wants it between two looks.
"""

import os
from collections.abc import Callable
from time import monotonic

from sms_handover.graph.topics import CONTROLLER, PLANT, RECORDER
from sms_handover.simulation.parameters import LOCKSTEP, CommonParameters

_MOST_MISSES = 3  # [-] in a row after which spinning is of no use for a while
_PAUSE = 200  # [-] waits without spinning then
_SPINNING = (PLANT, CONTROLLER)


def spin_of(node: str, common: CommonParameters, is_near: Callable[[], bool]) -> "AdaptiveSpin | None":
    """Return how a node spins while what it awaits ``is_near``, None if it does not.

    In lock step plant and controller keep a processor each; a recorder needs one of its own beside them.
    """
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    needed = len(_SPINNING) + (RECORDER in common.peers)
    if node not in _SPINNING or common.mode != LOCKSTEP or not common.spin or processors < needed:
        return None
    return AdaptiveSpin(common.spin, is_near)


class AdaptiveSpin:
    """Looks for something until it comes or ``longest_s`` have passed, as long as that pays off.

    Where others keep the processors busy, or an answer takes longer than that, sleeping costs less: after a
    few misses in a row it looks no more for a while. Nor does it unless what is awaited ``is_near``: whoever
    has to work for it first may need this processor, and Linux gives way between looks only within a session
    where it weighs those against each other (autogroup).
    """

    def __init__(self, longest_s: float, is_near: Callable[[], bool] = lambda: True) -> None:
        """Begin hopefully; with ``longest_s`` 0 s it never looks."""
        self._longest_s = longest_s
        self._is_near = is_near
        self._misses = 0
        self._pause = 0

    def find(self, take: Callable[[], bool]) -> bool:
        """Return whether ``take`` has taken something within the time."""
        if not self._is_near():
            return False
        if self._pause:
            self._pause -= 1
            return False
        deadline = monotonic() + self._longest_s
        while monotonic() < deadline:
            if take():
                self._misses = 0
                return True
            os.sched_yield()
        self._misses += 1
        if self._misses >= _MOST_MISSES:
            self._misses, self._pause = 0, _PAUSE
        return False
