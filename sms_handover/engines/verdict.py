"""Verdict of a second engine on a run: the largest differences, each with its bound."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from sms_handover.engines.bounds import BOUNDS, scenario_of_bounds
from sms_handover.engines.differences import Difference, differences
from sms_handover.engines.protocol import Engine
from sms_handover.engines.recording import replay_of
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario

_WIDTH = 20  # [characters] of the longest quantity and a space


@dataclass(frozen=True)
class Verdict:
    """What an engine says of a run; ``unsupported`` tells why it can say nothing, '' where it can.

    ``bounds`` is the scenario of which the bounds were taken.
    """

    engine: str
    bounds: str
    unsupported: str
    states: int
    differences: tuple[Difference, ...]

    @property
    def agrees(self) -> bool:
        """Whether every difference is within its bound."""
        return not self.unsupported and all(each.within for each in self.differences)

    def lines(self) -> Iterator[str]:
        """Yield the verdict in words: one line if the engine cannot replay the run, else one per quantity."""
        if self.unsupported:
            yield f"not supported by {self.engine}: {self.unsupported}"
            return
        against = f"{self.engine}, {self.states} states, bounds of scenario {self.bounds!r}"
        yield f"{'the same within bounds' if self.agrees else 'beyond bounds'}: {against}"
        for each in self.differences:
            mark = "" if each.within else "  beyond it"
            yield (
                f"  {each.quantity:<{_WIDTH}}{each.largest:8.1e} {each.unit:<9} at {each.time:6.2f} s, "
                f"bound {each.bound:.0e}{mark}"
            )

    def sentence(self) -> str:
        """Return the verdict in one line."""
        if self.unsupported:
            return f"not supported by {self.engine}: {self.unsupported}"
        worst = max(self.differences, key=lambda each: each.largest / each.bound)
        what = f"{worst.quantity} {worst.largest:.1e} {worst.unit}, bound {worst.bound:.0e}"
        return f"{'replayed by' if self.agrees else 'not confirmed by'} {self.engine}: {what}"

    def plain(self) -> dict[str, Any]:
        """Return the verdict as JSON has it."""
        found = [
            {
                **asdict(each),
                "largest": each.largest if isfinite(each.largest) else None,
                "within": each.within,
            }
            for each in self.differences
        ]
        return {**asdict(self), "agrees": self.agrees, "differences": found}


def verdict_of(engine: Engine, run: RunData, scenario: Scenario, name: str) -> Verdict:
    """Return what an engine says of a run that was made with a scenario, under the bounds of a name.

    Raises BagError where a state or an effort is missing.
    """
    replay = replay_of(run, scenario)
    bounds = scenario_of_bounds(name, carries=replay.deputy is not None)
    for effect in sorted(replay.effects, key=lambda each: each.value):
        if effect in engine.lacks:
            return Verdict(engine.title, bounds, f"{effect.value}: {engine.lacks[effect]}", 0, ())
    motion = engine.run(replay)
    found = differences(run, motion, BOUNDS[bounds])
    return Verdict(engine.title, bounds, "", replay.samples.size, found)
