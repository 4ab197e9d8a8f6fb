"""Command path: what becomes of a command on its way to the motors, in whole ticks."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sms_handover.conditions.random_streams import RandomStreams, TickNoise
from sms_handover.types import Array, freeze, read_only

_NAME = "command.dropped"


@dataclass(frozen=True, eq=False)
class CommandsOnTheWay:
    """The commands (n,) N m that are on their way, the oldest first, and the one that the motors have."""

    waiting: tuple[Array, ...]
    held: Array

    def __post_init__(self) -> None:
        freeze(self, "held")


class CommandPath:
    """Commands reach the motors ``delay`` ticks late, and some do not at all: the one before is then held.

    Each command is lost with the probability ``dropped``, whatever becomes of the others. Before the first
    one the motors have none: 0 N m.
    """

    def __init__(self, joints: int, delay: int, dropped: float, streams: RandomStreams) -> None:
        self._rest = read_only(np.zeros(joints))  # N m
        self._delay, self.dropped = delay, dropped
        self._losses: TickNoise = streams.noise(_NAME, 1)
        self.reset()

    def reset(self) -> None:
        """Go back to the start of a run."""
        self.state = CommandsOnTheWay((self._rest,) * self._delay, self._rest)

    def losses(self, first: int, ticks: int) -> npt.NDArray[np.bool_]:
        """Return whether the commands (ticks,) of some ticks from a first one on get lost."""
        if not self.dropped:
            return np.zeros(ticks, dtype=np.bool_)
        return self._losses.uniforms(first, ticks)[:, 0] < self.dropped

    def hold(self, waiting: Array, held: Array) -> None:
        """Go on with commands on their way (delay, n), the oldest first, and that which the motors have."""
        self.state = CommandsOnTheWay(tuple(map(read_only, waiting)), held)

    def arriving(self, tick: int, command: Array) -> Array:
        """Send the command (n,) N m of a tick, and return what the motors have in it."""
        line = (*self.state.waiting, command)
        lost = bool(self.losses(tick, 1)[0])
        held = self.state.held if lost else line[0]
        self.state = CommandsOnTheWay(line[1:], held)
        return held
