"""Margins of a schedule: what other masses, gains and ticks leave of clearance, rates and claims."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import numpy as np

from docs.tables import table
from sms_handover.analysis.claims import judge
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.metrics import RunMetrics, measure
from sms_handover.analysis.numbers import largest
from sms_handover.configuration.yaml_reader import load_mapping
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.model.assembly import ArmDescription, RobotDescription
from sms_handover.model.parts import Inertia
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import Scenario, World, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.trajectory.load import schedule_of
from sms_handover.trajectory.schedule import Schedule
from sms_handover.trajectory.time_law import TIME_LAWS
from sms_handover.units import MM_PER_M

SHARE = 0.05  # [-] by which values are changed
_RANDOM = 4  # [-] variations of everything at once
_SEED = 16
_GAINS = ("rolling_period", "proportional", "integral", "derivative")


@dataclass(frozen=True)
class Variation:
    """Factors on masses and inertias of base and arms in the plant alone, on gains, and on the tick."""

    name: str
    base: float = 1.0
    arms: float = 1.0
    gains: Mapping[str, float] = field(default_factory=dict)
    tick: float = 1.0


@dataclass(frozen=True)
class Margins:
    """What a schedule leaves under both laws.

    Least distance m outside declared contacts and in them, collisions, the largest share of a rate limit,
    peak torques N m of NMPC and PID, and the claims that do not hold.
    """

    apart: float
    contact: float
    collisions: int
    rate: float
    peaks: tuple[float, float]
    fails: tuple[str, ...]


def variations() -> Iterator[Variation]:
    """Yield the nominal case, each value changed by itself, half the tick, and random changes of all."""
    yield Variation("nominal")
    for sign in (1.0, -1.0):
        factor = 1.0 + sign * SHARE
        change = f"{100.0 * sign * SHARE:+.0f} %"
        yield Variation(f"base mass and inertia {change}", base=factor)
        yield Variation(f"arm masses and inertias {change}", arms=factor)
        for gain in _GAINS:
            yield Variation(f"{gain} {change}", gains={gain: factor})
    yield Variation("half the tick", tick=0.5)
    random = np.random.default_rng(_SEED)
    for number in range(1, _RANDOM + 1):
        base, arms, *gains = (float(value) for value in random.uniform(1.0 - SHARE, 1.0 + SHARE, 6))
        yield Variation(f"all at random, {number}", base, arms, dict(zip(_GAINS, gains, strict=True)))


def margins(schedule: Path, time_law: str, variation: Variation) -> Margins:
    """Return what a schedule leaves under a variation; simulates it under both laws."""
    runs = {law: _measured(schedule, time_law, law, variation) for law in (NMPC.name, PID.name)}
    clearances = [run.clearance for run in runs.values() if run.clearance is not None]
    groups = [group for clearance in clearances for group in clearance.groups]
    claims = judge(runs[NMPC.name], runs[PID.name])
    return Margins(
        apart=min(group.least for group in groups if group.allowed == 0.0),
        contact=min((group.least for group in groups if group.allowed < 0.0), default=np.inf),
        collisions=sum(len(clearance.collisions) for clearance in clearances),
        rate=max(run.limits.rate.value for run in runs.values() if run.limits is not None),
        peaks=(largest(runs[NMPC.name].torque.peak), largest(runs[PID.name].torque.peak)),
        fails=tuple(claim.name for claim in claims if not claim.holds),
    )


def margins_table(schedule: Path, time_law: str) -> str:
    """Return the margins under every variation as a table, and say how far it has got."""
    rows, number = [], count(1)
    for variation in variations():
        found = margins(schedule, time_law, variation)
        print(f"{schedule.name}, {next(number)}: {variation.name}", file=sys.stderr, flush=True)
        rows.append(
            (
                variation.name,
                f"{found.apart * MM_PER_M:.2f}",
                f"{found.contact * MM_PER_M:.2f}",
                str(found.collisions),
                f"{found.rate:.2f}",
                f"{found.peaks[0]:.2f}",
                f"{found.peaks[1]:.2f}",
                ", ".join(found.fails) or "none",
            )
        )
    heading = [
        "Changed",
        "apart [mm]",
        "contact [mm]",
        "collisions",
        "rate",
        "NMPC [N m]",
        "PID [N m]",
        "fail",
    ]
    return table(heading, rows)


def varied_robot(robot: RobotDescription, variation: Variation) -> RobotDescription:
    """Return a robot with other masses and inertias, all shapes and centres of mass the same."""

    def scaled(inertia: Inertia, factor: float) -> Inertia:
        moments = tuple(factor * value for value in inertia.moments)
        return replace(inertia, mass=factor * inertia.mass, moments=moments)

    def arm_of(arm: ArmDescription) -> ArmDescription:
        links = tuple(replace(link, inertia=scaled(link.inertia, variation.arms)) for link in arm.links)
        gripper = replace(arm.gripper, mass=variation.arms * arm.gripper.mass)
        return replace(arm, links=links, gripper=gripper)

    base = replace(robot.base, inertia=scaled(robot.base.inertia, variation.base))
    return replace(robot, base=base, arms=tuple(arm_of(arm) for arm in robot.arms))


def _measured(path: Path, time_law: str, law: str, variation: Variation) -> RunMetrics:
    """Return the metrics of a run; the laws know the nominal robot."""
    nominal = load_scenario("paper", {"law": law})
    known = nominal.parameters.controller
    gains = {
        f"controller.{name}": factor * float(getattr(known, name))
        for name, factor in variation.gains.items()
        if hasattr(known, name)
    }
    values = {
        "law": law,
        "common.dynamics": "compiled",
        "common.tick": variation.tick * nominal.parameters.common.tick,
        "trajectory.time_law": time_law,
        **gains,
    }
    parameters = load_scenario("paper", values).parameters
    robot, text = nominal.model.robot, path.read_text(encoding="utf-8")
    schedule = schedule_of(load_mapping(text, path), text, robot, parameters.common.reference_ns)
    schedule = _with_gains(schedule, variation.gains)
    model = World(robot, schedule)
    truth = World(RobotModel(varied_robot(robot.description, variation)), schedule)
    run = simulate(Scenario(parameters, truth, model))
    return measure(run, texts=TaskTexts(truth.robot.urdf, text))


def _with_gains(schedule: Schedule, factors: Mapping[str, float]) -> Schedule:
    """Return a schedule with the gains of its phases multiplied."""
    phases = []
    for phase in schedule.phases:
        gains = {
            law: {name: factors.get(name, 1.0) * float(str(value)) for name, value in of_law.items()}
            for law, of_law in phase.gains.items()
        }
        phases.append(replace(phase, gains=gains))
    return replace(schedule, phases=tuple(phases))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m docs.geometry_margins", description=__doc__)
    parser.add_argument("schedule", type=Path)
    parser.add_argument("--time-law", choices=tuple(TIME_LAWS), default="step")
    options = parser.parse_args()
    print(margins_table(options.schedule, options.time_law))
