"""Verdict of a second engine on a run: the largest differences, each with its bound."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from sms_handover.analysis.numbers import angle_between, complete, lengths
from sms_handover.engines.bounds import BOUNDS, Bounds, scenario_of_bounds
from sms_handover.engines.protocol import Engine, Motion
from sms_handover.engines.recording import compared_periods, replay_of
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.types import BASE_NQ, Array
from sms_handover.units import ns_to_seconds

_WIDTH = 20  # [characters] of the longest quantity and a space


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
    replay, bounds = replay_of(run, scenario), scenario_of_bounds(name)
    for effect in sorted(replay.effects, key=lambda each: each.value):
        if effect in engine.lacks:
            return Verdict(engine.title, bounds, f"{effect.value}: {engine.lacks[effect]}", 0, ())
    motion = engine.run(replay)
    return Verdict(
        engine.title,
        bounds,
        "",
        replay.samples.size,
        tuple(_differences(run, motion, replay.samples, BOUNDS[bounds])),
    )


def _differences(run: RunData, motion: Motion, samples: np.ndarray, bounds: Bounds) -> Iterator[Difference]:
    """Yield the largest difference of each quantity, of the states of which it was recorded."""
    periods = compared_periods(run)
    base, joints = run.base_pose[samples], run.joint_position[samples]
    found = [("joints", "rad", bounds.joints, _largest, [(motion.q[:, BASE_NQ:], joints)])]
    tools = [(motion.tools[arm], run.tool_pose[arm][periods]) for arm in run.arms]
    for name, pairs, at, turned in (
        ("base", [(motion.q[:, :BASE_NQ], base)], bounds.base_position, bounds.base_attitude),
        ("tool", tools, bounds.tool_position, bounds.tool_attitude),
    ):
        found.append((f"{name} position", "m", at, _distances, [(a[:, :3], b[:, :3]) for a, b in pairs]))
        found.append(
            (f"{name} attitude", "rad", turned, angle_between, [(a[:, 3:], b[:, 3:]) for a, b in pairs])
        )
    linear = motion.linear_momentum, run.linear_momentum[periods]
    angular = motion.angular_momentum, run.angular_momentum[periods]
    found.append(("linear momentum", "kg m/s", bounds.linear_momentum, _distances, [linear]))
    found.append(("angular momentum", "kg m^2/s", bounds.angular_momentum, _distances, [angular]))
    for quantity, unit, bound, apart, pairs in found:
        recorded = np.flatnonzero(np.all([complete(theirs) for _, theirs in pairs], axis=0))
        if recorded.size:
            values = np.max([apart(ours[recorded], theirs[recorded]) for ours, theirs in pairs], axis=0)
            place = int(np.argmax(values))  # of a NaN, if the engine diverged
            time = ns_to_seconds(int(run.tick_ns[samples[recorded[place]]]))
            yield Difference(quantity, float(values[place]), unit, time, bound)


def _largest(a: Array, b: Array) -> Array:
    return np.asarray(np.max(np.abs(a - b), axis=1))


def _distances(a: Array, b: Array) -> Array:
    return lengths(a - b)
