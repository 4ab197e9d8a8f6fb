"""Mass runs: handovers of deputies of some masses, by laws that know the mass or do not."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from docs.measurement_folder import KeptRows
from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.analysis.completion import collisions_in_words
from sms_handover.analysis.numbers import angle_between
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.errors import UnstableLoopError
from sms_handover.graph.events import Severity
from sms_handover.model.known_payload import KnownPayload
from sms_handover.model.poses import se3_of
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.run_data import RunData
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.feasibility import check_feasibility
from sms_handover.simulation.observed_ticks import Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import gains_by_phase
from sms_handover.types import GraspStatus
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

MASSES = (1.0, 2.0, 4.0, 8.0, 12.0, 16.0, 20.0, 24.0)  # [kg]
# What a law believes: the factor by which it takes the mass; 0 is a deputy without mass.
BELIEFS = {"known": 1.0, "half of it": 0.5, "twice of it": 2.0, "unknown": 0.0}
LAWS = (NMPC.name, PID.name)
# CubeSat Design Specification, rev. 14: the largest mass of a size, its edges with the long one along y.
SIZES = {
    "3U": (6.0, (0.1, 0.34, 0.1)),  # kg, m
    "6U": (12.0, (0.1, 0.366, 0.226)),
    "12U": (24.0, (0.226, 0.366, 0.226)),
}
FIRST = "colliding"  # the geometry that an earlier prototype was measured in, a 3U at every mass
_COMMON = {"common.dynamics": "compiled", "common.on_touch": "report"}  # quick; touches are found afterwards
_FIRST_CASES = (
    *((mass, belief, NMPC.name) for belief in ("known", "unknown") for mass in (1.0, 4.0, 12.0)),
    *((12.0, belief, NMPC.name) for belief in ("half of it", "twice of it")),
    *((mass, "known", NMPC.name) for mass in (24.0, 27.0)),
    *((mass, "known", PID.name) for mass in (1.0, 4.0, 8.0)),
)


@dataclass(frozen=True)
class Case:
    """One run: a scenario, the mass in kg, what the law believes of it, and the law."""

    scenario: str
    mass: float
    belief: str
    law: str


@dataclass(frozen=True)
class Outcome:
    """What came of a run: in words, the distance of each grasp in mm, and its largest figures.

    ``turn`` deg is the farthest that the base was from its first attitude, ``peak`` N m the largest torque
    from the capture on.
    """

    words: str
    distances: Sequence[float] = ()
    turn: float = 0.0
    peak: float = 0.0


@dataclass(frozen=True)
class Load:
    """What a mass in the hand does: the largest inertia of a joint in kg m^2, and the largest growth of one.

    ``growth`` is the largest eigenvalue k of H*^-1 H*' of the arm, with the deputy in H*'. A law that does
    not know it has k e'' + A_2 e' + A_1 e = 0 in that direction: errors decay in ``decay`` = 2 k / A_2 s.
    """

    inertia: float
    growth: float
    decay: float


def cases() -> list[Case]:
    """Return all runs of the page."""
    first = [Case(FIRST, mass, belief, law) for mass, belief, law in _FIRST_CASES]
    # PID does not ask what the deputy weighs: only its references could tell.
    beliefs = {NMPC.name: tuple(BELIEFS), PID.name: ("known", "unknown")}
    paper = [Case("paper", mass, belief, law) for law in LAWS for mass in MASSES for belief in beliefs[law]]
    return [*paper, *first]


def size_of(mass: float) -> str:
    """Return the least size that may have a mass in kg."""
    return next(name for name, (most, _) in SIZES.items() if mass <= most)


def scenario_of(case: Case) -> Scenario:
    """Return the scenario of a case.

    A larger body has its centre farther from the robot, so that the grasp frames are where they were.
    """
    values: dict[str, object] = {"law": case.law, "deputy.mass": case.mass, **_COMMON}
    if case.scenario != FIRST:
        values.update(placed(case.scenario, SIZES[size_of(case.mass)][1]))
    factor = BELIEFS[case.belief]
    if factor != 1.0:
        values["model.deputy.mass"] = factor * case.mass
    return load_scenario(case.scenario, values)


def outcome_of(case: Case) -> Outcome:
    """Return what comes of a case; its run ends with the first grasp that misses."""
    scenario = scenario_of(case)
    if case.law == PID.name and case.scenario != FIRST:  # there it runs, as the prototype did; nmpc is stable
        try:
            check_scenario(scenario)
        except UnstableLoopError:
            return Outcome("rejected as unstable")
    run = simulate(scenario, until=_grasp_missed)
    attitude = run.base_pose[:, 3:]
    turn = float(np.max(angle_between(attitude[:1], attitude))) * DEG_PER_RAD
    held = run.tick_ns > run.grasp_events[0].stamp_ns  # before, no mass is in the hand
    peak = float(np.max(np.abs(run.joint_effort[held]), initial=0.0))
    distances = tuple(event.position_error * MM_PER_M for event in run.grasp_events)
    return Outcome(_words(case, scenario, run), distances, turn, peak)


def load_of(mass: float) -> Load:
    """Return what a mass in the hand of arm A does to its joints, where phase ``carry`` of ``paper`` ends."""
    scenario = scenario_of(Case("paper", mass, "known", NMPC.name))
    robot, schedule = scenario.model.robot, scenario.model.schedule
    _, end, *_ = check_feasibility(robot, schedule, scenario.parameters.ik)
    payload = KnownPayload(robot, schedule.deputy)
    payload.hold(schedule.grips[1])
    q, part = robot.configuration(end.base_in_world, end.joint_position), robot.arm_joints[payload.grip.arm]
    bare, loaded = (
        reduced_dynamics(each, q, np.zeros(each.pin.nv)).inertia[part, part]
        for each in (robot, payload.robot)
    )
    ratio = float(np.max(np.linalg.eigvals(np.linalg.solve(bare, loaded)).real))
    softer = gains_by_phase(schedule, scenario.parameters.controller)[1]
    return Load(float(np.diag(loaded).max()), ratio, 2.0 * ratio / softer.velocity_gain)


def grown(folder: Path, part: Sequence[Case]) -> Mapping[Case, Outcome]:
    """Return the outcomes of some cases; those that a folder lacks are worked out and added to its file."""
    kept = KeptRows(folder / "rows.jsonl")
    found = {
        Case(**row["case"]): Outcome(**{**row["outcome"], "distances": tuple(row["outcome"]["distances"])})
        for row in kept.rows
    }
    for case in part:
        if case not in found:
            outcome = found[case] = outcome_of(case)
            kept.add({"case": asdict(case), "outcome": asdict(outcome)})
            print(case, outcome, flush=True)
    return found


def placed(name: str, size: tuple[float, ...]) -> dict[str, object]:
    """Return the values by which the deputy of a scenario gets a size while its grasp frames stay."""
    deputy = load_scenario(name).truth.schedule.deputy
    back = np.array([(size[0] - deputy.size[0]) / 2.0, 0.0, 0.0])
    centre = se3_of(deputy.deputy_in_world).act(back)
    frames = {
        f"deputy.grasp_frames.{frame}.xyz": (pose.position - back).tolist()
        for frame, pose in deputy.grasp_frames.items()
    }
    return {"deputy.size": list(size), "deputy.in_world.xyz": centre.tolist(), **frames}


def _grasp_missed(ticks: Ticks | QuietPeriods) -> bool:
    """Whether a grasp has missed; in quiet periods there is none."""
    period = ticks.period if isinstance(ticks, Ticks) else None
    return period is not None and any(event.status is not GraspStatus.SUCCEEDED for event in period.events)


def _words(case: Case, scenario: Scenario, run: RunData) -> str:
    """Return how a run ended."""
    for event in run.grasp_events:
        if event.status is not GraspStatus.SUCCEEDED:
            return f"{event.command.action.value} missed by {event.position_error * MM_PER_M:.0f} mm"
    failed = next((phase for phase in run.phases if phase.failed), None)
    if failed:
        why = [event.kind for event in run.run_events if event.severity is Severity.ERROR]
        return f"{why[-1]} at {ns_to_seconds(failed.stamp_ns):.0f} s"
    if case.scenario != FIRST:
        world = scenario.truth
        touched = collisions_in_words(run_clearance(run, TaskTexts(world.robot.urdf, world.schedule.text)))
        if touched:
            return f"collides: {touched[0]}"
    return "completes"
