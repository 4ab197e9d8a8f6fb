"""Search for geometries of the handover in which nothing touches: draw, try under both laws, improve."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from docs.geometry_candidates import (
    APPROACH,
    CARRY,
    WITHDRAW,
    Design,
    Geometry,
    design_of,
    drawn,
    redrawn,
    resolved,
    schedule_text,
    varied,
)
from docs.geometry_trial import Bench, Trial
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.errors import ScheduleError
from sms_handover.units import MM_PER_M

FOLDER = Path("build/geometries")
_PATIENCE = 20  # [-] draws of one phase before the one before it is drawn anew
_DRAWS = 3000  # [-] before a candidate is given up
_REPAIRS = 12  # [-] times a candidate that fails in simulation is drawn anew in the phase in which it failed
_LEEWAY = 0.001  # [m] by which a variation may come nearer than the best so far before its run is ended

Report = Callable[[str], None]


@dataclass
class Tally:
    """How many candidates got how far: ``simulated`` ones, and why those failed that did."""

    drawn: int = 0
    simulated: int = 0
    failures: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True, eq=False)
class Found:
    """A possible geometry and what came of it."""

    geometry: Geometry
    trial: Trial

    @property
    def text(self) -> str:
        """Its schedule as YAML."""
        return schedule_text(self.geometry)


def possible(
    bench: Bench, random: np.random.Generator, tally: Tally, report: Report, *, wide: bool = False
) -> Iterator[Found]:
    """Yield possible geometries without end, whatever the claims come to.

    A candidate that fails is drawn anew in the phase in which it failed, so all have passed the same tests:
    targets in reach, no two bodies that touch under either law, joints within their limits, every grasp made.
    """
    while True:
        tally.drawn += 1
        geometry = _free(bench, drawn(random, wide=wide), "", random, tally, wide=wide)
        for _ in range(_REPAIRS):
            if geometry is None:
                break
            tally.simulated += 1
            trial = bench.trial(bench.schedule(schedule_text(geometry)))
            failed = trial.failed
            report(_line(trial))
            if failed is None:
                yield Found(geometry, trial)
                break
            tally.failures[f"{failed.phase}: {failed.failure}"] += 1
            geometry = _free(bench, geometry.design, failed.phase, random, tally, wide=wide)


def improved(
    bench: Bench, found: Found, random: np.random.Generator, trials: int, report: Report
) -> Iterator[Found]:
    """Yield ever better geometries, varied at random, until ``trials`` have been simulated."""
    best, least = found, shortfall(found.trial)
    simulated = 0
    while simulated < trials:
        design = varied(best.geometry.design, random, float(random.choice([0.3, 1.0])))
        geometry = resolved(design, bench.robot, bench.ik)
        if isinstance(geometry, str) or bench.collides(geometry):
            continue
        simulated += 1
        trial = bench.trial(bench.schedule(schedule_text(geometry)), max(0.0, best.trial.least - _LEEWAY))
        value = shortfall(trial)
        if value < least:
            best, least = Found(geometry, trial), value
            report(f"{simulated}: {_line(trial)}")
            yield best


def shortfall(trial: Trial) -> float:
    """Return by how much a trial falls short of what the shipped geometry should have, 0 if in nothing.

    Each wish counts in its own unit: 3.5 mm of distance, peak torques about 2 N m, rates below three
    quarters of their limits, NMPC settled 0.7 s earlier in every motion, and every claim.
    """
    if trial.failed or trial.peaks is None:
        return float("inf")
    nmpc, pid = trial.peaks[NMPC.name], trial.peaks[PID.name]
    wishes = (
        3.5 - trial.least * MM_PER_M,  # mm
        4.0 * (1.7 - nmpc),  # quarters of N m, like the next ones
        6.0 * (nmpc - 2.3),
        6.0 * (1.35 - pid),
        4.0 * (pid - 2.3),
        6.0 * (trial.rate - 0.75),  # [-]
        0.7 - trial.lead,  # s
        *(2.0 for claim in trial.claims if not claim.holds and claim.name != "peak_torque"),
    )
    return sum(max(0.0, wish) for wish in wishes)


def _free(
    bench: Bench, design: Design, phase: str, random: np.random.Generator, tally: Tally, *, wide: bool
) -> Geometry | None:
    """Return a geometry free of collision at rest and on straight paths, with ``phase`` drawn anew first."""
    fails: Counter[str] = Counter()
    for _ in range(_DRAWS):
        if phase:
            design = redrawn(design, phase, random, wide=wide)
        geometry = resolved(design, bench.robot, bench.ik)
        phase = geometry if isinstance(geometry, str) else bench.collides(geometry)
        if not isinstance(geometry, str):
            design = geometry.design
            if not phase:
                return geometry
        fails[phase] += 1
        if fails[phase] > _PATIENCE and phase != APPROACH:
            fails[phase] = 0
            if phase == WITHDRAW:
                phase = CARRY
            else:
                design, phase = redrawn(design, WITHDRAW, random, wide=wide), APPROACH
    return None


def _begun(bench: Bench, file: Path) -> Found:
    """Return the geometry in a file and what comes of it; raises ScheduleError if it is out of reach."""
    design = design_of(bench.schedule(file.read_text(encoding="utf-8")), bench.robot, bench.ik)
    geometry = resolved(design, bench.robot, bench.ik)
    if isinstance(geometry, str):
        raise ScheduleError(f"{file}: phase {geometry!r} is out of reach")
    return Found(geometry, bench.trial(bench.schedule(schedule_text(geometry))))


def _line(trial: Trial) -> str:
    """Return one line on a trial."""
    failed = trial.failed
    if failed or trial.peaks is None:
        return f"{failed.phase}: {failed.failure}" if failed else "no claims"
    peaks = ", ".join(f"{law} {peak:.2f} N m" for law, peak in trial.peaks.items())
    missed = ", ".join(claim.name for claim in trial.claims if not claim.holds) or "none"
    return (
        f"possible: least {trial.least * MM_PER_M:.2f} mm, rates {trial.rate:.2f}, {peaks}, "
        f"lead {trial.lead:.2f} s, claims that fail: {missed}, shortfall {shortfall(trial):.2f}"
    )


def main(arguments: list[str]) -> None:
    """Find geometries, improve the best one, and write them."""
    parser = argparse.ArgumentParser(prog="python -m docs.geometry_search", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of every random number")
    parser.add_argument("--count", type=int, default=1, help="geometries to find")
    parser.add_argument("--improve", type=int, default=0, help="variations of the best one to simulate")
    parser.add_argument("--begin", type=Path, help="schedule of an earlier search to improve instead")
    parser.add_argument("--wide", action="store_true", help="an upright deputy, far out")
    parser.add_argument("--output", type=Path, default=FOLDER, help="folder for the schedules")
    options = parser.parse_args(arguments)
    bench, random, tally = Bench(), np.random.default_rng(options.seed), Tally()

    def report(line: str) -> None:
        print(f"[{tally.drawn} drawn, {tally.simulated} simulated] {line}", flush=True)

    options.output.mkdir(parents=True, exist_ok=True)
    pool: list[Found] = []
    if options.begin:
        pool.append(_begun(bench, options.begin))
        report(_line(pool[0].trial))
    finds = possible(bench, random, tally, report, wide=options.wide)
    while len(pool) < options.count:
        pool.append(next(finds))
        name = f"geometry_{options.seed}_{len(pool)}.yaml"
        (options.output / name).write_text(pool[-1].text, encoding="utf-8")
    best = min(pool, key=lambda found: shortfall(found.trial))
    for better in improved(bench, best, random, options.improve, report):
        best = better
        (options.output / f"improved_{options.seed}.yaml").write_text(best.text, encoding="utf-8")
    print(f"best: {_line(best.trial)}")


if __name__ == "__main__":
    main(sys.argv[1:])
