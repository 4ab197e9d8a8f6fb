"""Base wrenches that others ask for while a run goes on, each kept until the tick of its stamp."""

from collections.abc import Iterable, Iterator

import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, at_point
from sms_handover.errors import MessageError, Reason
from sms_handover.frames import BASE, WORLD
from sms_handover.types import Array, BaseWrench
from sms_handover.units import ns_to_seconds

FRAMES = (WORLD, BASE)
_UPRIGHT = np.eye(3)
_ORIGIN = np.zeros(3)  # m


class BaseWrenches:
    """What acts on base_link over single ticks: one wrench a tick, that of the first message for it."""

    def __init__(self, tick_ns: int) -> None:
        """Begin without any."""
        self._tick_ns = tick_ns
        self._by_tick: dict[int, BaseWrench] = {}

    def __iter__(self) -> Iterator[BaseWrench]:
        """Return all of them in order of time, with the stamps of their ticks."""
        return (self._by_tick[tick] for tick in sorted(self._by_tick))

    def add(self, wrench: BaseWrench, tick: int) -> None:
        """Keep a wrench for the tick in which its stamp lies; ``tick`` is the next to be integrated.

        Raises MessageError if that tick is over or has a wrench already, and on a frame that is none of
        ``world`` and ``base_link``.
        """
        if wrench.frame not in FRAMES:
            names = " or ".join(map(repr, FRAMES))
            raise MessageError(Reason.FRAME, f"a wrench is in frame {wrench.frame!r}, must be {names}")
        wanted = wrench.stamp_ns // self._tick_ns
        if wanted < tick:
            now = f"the run is at {ns_to_seconds(tick * self._tick_ns):g} s"
            raise MessageError(Reason.OLD, f"stamped {ns_to_seconds(wrench.stamp_ns):g} s, but {now}")
        if wanted in self._by_tick:
            at = f"the tick at {ns_to_seconds(wanted * self._tick_ns):g} s has a wrench already"
            raise MessageError(Reason.DUPLICATE, at)
        stamp_ns = wanted * self._tick_ns
        self._by_tick[wanted] = BaseWrench(stamp_ns, wrench.frame, wrench.force, wrench.torque)

    def clear(self) -> None:
        """Forget all of them, as at the start of another run."""
        self._by_tick.clear()

    def at(self, tick: int) -> BaseWrench | None:
        """Return the wrench of a tick, None if it has none."""
        return self._by_tick.get(tick)


class AskedWrenches:
    """The wrenches that others asked for in a run, as a model of one wrench."""

    def __init__(self, wrenches: Iterable[BaseWrench], tick_ns: int) -> None:
        """Take those of a run with ticks of ``tick_ns``."""
        self._by_tick = {wrench.stamp_ns // tick_ns: wrench for wrench in wrenches}

    def over(self, start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
        """Return the wrench over the tick that begins at ``start_s``, zero where none was asked for."""
        asked = self._by_tick.get(round(start_s / tick_s))
        return in_world(asked, body.rotation) if asked else Wrench(_ORIGIN, _ORIGIN)


def in_world(wrench: BaseWrench, base_in_world: Array) -> Wrench:
    """Return a wrench in axes of ``world``, by the rotation (3, 3) of the base at the start of its tick."""
    force, torque = np.array(wrench.force), np.array(wrench.torque)
    return at_point(force, torque, _ORIGIN, base_in_world if wrench.frame == BASE else _UPRIGHT)
