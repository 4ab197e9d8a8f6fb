"""Acceptance runs of the laws with a model: writes a section of docs/control.md.

Runs of the same sources that are in build/acceptance/ from before are not repeated.
"""

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import numpy as np

from docs.measurement_folder import measurement_folder
from docs.tables import table
from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.analysis.completion import completion
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.errors import NoPlanError
from sms_handover.plan_report import PlanStatus
from sms_handover.run_data import RunData
from sms_handover.simulation.near_pairs import NearPairs
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_clearance
from sms_handover.types import BASE_NQ, GraspStatus
from sms_handover.units import MM_PER_M, ns_to_seconds

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "control.md"
TICK = 0.004  # [s], four times the shipped one, to save time
SLOW = 0.005  # [s], of which the periods of the sensors of nominal conditions are multiples
GRASPED = 40.1  # [s], just after the transfer of the scenarios that are cut off there
BOUND = 30.0  # [s], beyond the middle of the second motion of `tight`: all of its limits have bound by then
SEEDS = range(1, 21)
OBSERVER = {"controller.disturbance_bandwidth": 20.0}  # 1/s
_VISCOUS, _DRY = 2.0, 2.5  # N m s/rad, N m: the friction of the Gen3, see docs/conditions.md
_EVERY = 25  # [ticks] between configurations whose distances are looked at
_HEAD, _NEXT = "## What the laws carry\n", "## Gains and tick\n"
Values = Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What came of a run: distances at grasps in mm, what it lacks of its task, peaks, and what plans say."""

    grasps: tuple[float, ...]
    grasped: bool
    lacks: tuple[str, ...]
    joint_rate: float  # rad/s
    base_rate: float  # rad/s
    distance: float  # m, least, between bodies that are not of one arm, without the deputy
    without_plan: int
    ended: str

    @property
    def worst(self) -> float:
        """The largest distance at a grasp, mm."""
        return max(self.grasps, default=nan)


def friction(share: float) -> Values:
    """Return a share of the friction of the Gen3 as conditions, with rotors."""
    values = {"viscous": share * _VISCOUS, "coulomb": share * _DRY, "stiction": 1.2 * share * _DRY}
    return {"conditions.rotor_inertia": 0.31, "conditions.friction": {**values, "stribeck_speed": 0.01}}


def believed(share: float) -> Values:
    """Return a law that believes that there is a share of the friction of the Gen3."""
    return {"controller.friction_viscous": share * _VISCOUS, "controller.friction_coulomb": share * _DRY}


SHARES = (0.01, 0.1)
OPTIONS: Mapping[str, Any] = {
    "none": lambda _: {},
    "integral action": lambda _: {"controller.integral_time": 1.0},
    "observer": lambda _: OBSERVER,
    "feed-forward, 80 % believed": lambda share: believed(0.8 * share),
    "feed-forward, 80 %, and observer": lambda share: {**believed(0.8 * share), **OBSERVER},
}
WRONG = {
    "model.robot.base.mass": 192.0,  # kg, a fifth less than in truth
    "model.robot.arms.arm_a.gripper.mass": 1.2902,  # kg, twice that in truth
    "model.robot.arms.arm_b.gripper.mass": 1.2902,
}
MARGIN = 0.1
IMPOSSIBLE = {"controller.least_distance": 0.3}  # m, where the arms begin nearer to each other


def cases() -> Iterator[tuple[str, str, Values]]:
    """Return all runs: a name, a scenario and values over it."""
    mpc = {"law": "mpc", "common.tick": TICK}
    for name in scenario_names():
        yield f"scenario {name}", name, mpc
    begun = {**mpc, "common.duration": BOUND}
    yield "wrong model", "tight", {**begun, **WRONG}
    yield "wrong model, margin", "tight", {**begun, **WRONG, "controller.limit_margin": MARGIN}
    yield "impossible", "tight", {**mpc, **IMPOSSIBLE}
    for law in ("nmpc", "mpc"):
        for share in SHARES:
            for option, values in OPTIONS.items():
                run: dict[str, object] = {"law": law, "common.tick": TICK}
                run |= {"common.duration": GRASPED, "seed": 1}
                opened = {"plant.grasp_position_tolerance": 10.0, "plant.grasp_angle_tolerance": 3.2}
                yield (
                    f"{law} {share:g} {option}",
                    "smooth",
                    {**run, **opened, **friction(share), **values(share)},
                )
    for seed in SEEDS:
        run = {"law": "mpc", "common.tick": SLOW, "common.duration": GRASPED, "seed": seed}
        nominal = {"common.conditions": "nominal", "conditions.command.delay": SLOW}
        yield f"nominal {seed}", "smooth", {**run, **nominal, **OBSERVER}


def outcome_of(scenario: Scenario) -> Outcome:
    """Return what comes of a scenario."""
    try:
        run = simulate(scenario)
    except NoPlanError as error:
        return Outcome((), False, (str(error),), nan, nan, nan, 0, str(error))
    events, truth = run.grasp_events, scenario.truth
    held = [event.status is GraspStatus.SUCCEEDED for event in events]
    clearance = run_clearance(run, TaskTexts(truth.robot.urdf, truth.schedule.text))
    return Outcome(
        tuple(event.position_error * MM_PER_M for event in events if not isnan(event.position_error)),
        bool(held) and all(held) and not any(phase.failed for phase in run.phases),
        completion(run, clearance).shortfalls,
        float(np.abs(run.joint_velocity).max()),
        float(np.abs(run.base_twist[:, 3:]).max()),
        _least_distance(scenario, run),
        sum(report.status is not PlanStatus.SOLVED for report in run.plans),
        f"ended at {ns_to_seconds(int(run.tick_ns[-1])):g} s",
    )


def _least_distance(scenario: Scenario, run: RunData) -> float:
    """Return the least distance in m between bodies that are not of one arm, without the deputy."""
    if not scenario.parameters.controller.least_distance:
        return nan
    near = NearPairs(make_clearance(scenario.truth.robot, scenario.truth.schedule))
    counted = np.array([not (pair.one_arm or pair.has_deputy) for pair in near.pairs])
    deputy, least = scenario.truth.schedule.deputy.deputy_in_world, inf
    for base, joints in zip(run.base_pose[::_EVERY], run.joint_position[::_EVERY], strict=True):
        q = np.concatenate([base[:BASE_NQ], joints])
        least = min(least, float(near.distances(q, deputy)[counted].min()))
    return least


def measured(wanted: str) -> dict[str, Outcome]:
    """Return the outcomes of all runs whose name begins so, and of those from before."""
    folder, found = measurement_folder("acceptance"), {}
    folder.mkdir(parents=True, exist_ok=True)
    for name, scenario, values in cases():
        file = folder / f"{name.replace(' ', '_').replace('%', 'percent')}.json"
        if not file.exists():
            if not name.startswith(wanted):
                continue
            outcome = outcome_of(load_scenario(scenario, values))
            file.write_text(json.dumps(asdict(outcome), indent=1) + "\n", encoding="utf-8")
            print(name, outcome, flush=True)
        content = json.loads(file.read_text(encoding="utf-8"))
        found[name] = Outcome(**{**content, **{key: tuple(content[key]) for key in ("grasps", "lacks")}})
    return found


def section(found: Mapping[str, Outcome]) -> str:
    """Return the text of the section."""
    limits = load_scenario("tight").parameters.controller
    by_name = ("Scenario", "Grasp and transfers [mm]", "Completes", "Solves without a plan")
    completed = [
        (f"`{name.removeprefix('scenario ')}`", _grasps(one), _completes(one), str(one.without_plan))
        for name, one in _of(found, [f"scenario {name}" for name in scenario_names()])
    ]
    kept = (
        "`tight`",
        f"Joint rate, at most {limits.joint_rate_limit:g} rad/s",
        f"Base rate, at most {limits.base_rate_limit:g} rad/s",
        f"Distance, at least {limits.least_distance * MM_PER_M:g} mm",
    )
    names = {
        "scenario tight": "right model, whole task",
        "wrong model": f"base 20 % too light, grippers twice too heavy, up to {BOUND:g} s",
        "wrong model, margin": f"the same, `limit_margin` {MARGIN:g}",
    }
    constrained = [
        (
            names[name],
            f"{one.joint_rate:.5f}",
            f"{one.base_rate:.6f}",
            f"{one.distance * MM_PER_M:.2f}",
        )
        for name, one in _of(found, names)
    ]
    seeds = [one for _, one in _of(found, [f"nominal {seed}" for seed in SEEDS])]
    worst = max((one.worst for one in seeds), default=nan)
    rows = []
    for law in ("nmpc", "mpc"):
        for option in OPTIONS:
            cells = [found.get(f"{law} {share:g} {option}") for share in SHARES]
            rows.append((f"`{law}`", option, *("" if one is None else _missed(one) for one in cells)))
    shares = ("Law", "Option", *(f"{100.0 * share:g} %: grasp, transfer [mm]" for share in SHARES))
    impossible = found["impossible"].ended if "impossible" in found else ""
    most = [one for _, one in _of(found, [f"{law} {SHARES[-1]:g} observer" for law in ("nmpc", "mpc")])]
    carried = max((one.worst for one in most), default=nan)
    room, observer = IMPOSSIBLE["controller.least_distance"], OBSERVER["controller.disturbance_bandwidth"]
    return f"""\
This section is written by `make acceptance`. The tick is {TICK * 1e3:g} ms.

{table(by_name, completed)}

{table(kept, constrained)}

Distances are those between bodies of different arms and the base, each {_EVERY} ticks. A limit that the
task cannot meet, `-p controller.least_distance:={room:g}`, ends the run with

> {impossible}

Under `nominal` conditions, with the observer ({observer:g} 1/s) and tick and delay of {SLOW * 1e3:g} ms,
`mpc` makes both grasps of `smooth` for {sum(one.grasped for one in seeds)} of {len(seeds)} seeds,
within {worst:.2f} mm.

Shares of the friction of the Gen3 ([conditions](conditions.md)) alone, in `smooth`, with tolerances opened;
**bold** is where a grasp would have missed (10 mm). With the observer both laws are within {carried:.2f} mm
at {100.0 * SHARES[-1]:g} %:

{table(shares, rows)}
"""


def _of(found: Mapping[str, Outcome], names: Sequence[str] | Mapping[str, str]) -> list[tuple[str, Outcome]]:
    """Return the outcomes of some names that are there, each with its name."""
    return [(name, found[name]) for name in names if name in found]


def _grasps(one: Outcome) -> str:
    return ", ".join(f"{mm:.4f}" for mm in one.grasps)


def _missed(one: Outcome) -> str:
    text = ", ".join(f"{mm:.2f}" for mm in one.grasps)
    return f"**{text}**" if not one.worst <= 10.0 else text


def _completes(one: Outcome) -> str:
    return f"no: {one.lacks[0]}" if one.lacks else "yes"


def with_section(page: str, text: str) -> str:
    """Return a page with another text in the section that is written here."""
    begin = page.index(_HEAD) + len(_HEAD)
    return f"{page[:begin]}\n{text}\n{page[page.index(_NEXT, begin) :]}"


def main() -> None:
    """Carry out the runs whose names begin with the argument, all without one; write the section."""
    found = measured(" ".join(sys.argv[1:]))
    PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), section(found)), encoding="utf-8")
    print(f"{PAGE.name} written from {len(found)} runs")


if __name__ == "__main__":
    main()
