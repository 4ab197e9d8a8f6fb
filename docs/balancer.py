"""Balancer measured: base turn against tool error and clearance; writes a section of docs/balancer.md."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("svg")  # draws into a file; needs no display

import matplotlib.pyplot as plt
import numpy as np

from docs.tables import table
from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.analysis.signals import base_rotation, base_turn_rate
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.units import DEG_PER_RAD, MM_PER_M

PAGE = Path(__file__).resolve().parent / "balancer.md"
PICTURE = PAGE.parent / "images" / "balancer.svg"
_HEAD, _NEXT = "## Measured\n", "## "
SECONDS = 20.02  # [s] the phases up to the first grasp, in which arm B is idle, and the grasp
TICK = 0.01  # [s], ten times the shipped one, to save time
WORKS, IDLE = "arm_a", "arm_b"
SHIPPED, EARLIER = "smooth", "colliding"  # a scenario with room, and the geometry of the earlier prototype


@dataclass(frozen=True)
class Case:
    """One run: a scenario, the weight of base turns in s^2/rad^2, the least distance in m, a limit of rates.

    ``rate_limit`` is in rad/s, 0 is that of the robot.
    """

    scenario: str
    weight: float
    keep_apart: float
    rate_limit: float = 0.0

    @property
    def name(self) -> str:
        """What arm B does, as text."""
        if self.weight == 0.0:
            return "held (weight 0)"
        limit = f", all rates <= {self.rate_limit:g} rad/s" if self.rate_limit else ""
        return f"weight {self.weight:.0e}{limit}"


@dataclass(frozen=True)
class Outcome:
    """Figures of a run: farthest turn of the base in deg, its largest rate in deg/s, and what it costs.

    ``tool`` is the largest error of the working tool in mm, ``grasp`` that of the grasp; ``rate`` rad/s the
    largest joint rate of the idle arm, ``least`` mm how near it came to anything; ``active`` are the bounds
    of distances that it met.
    """

    turn: float
    turn_rate: float
    tool: float
    grasp: float
    rate: float
    least: float
    active: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """What came of a whole task: errors of its grasps in mm, farthest and last turn of the base in deg."""

    grasps: tuple[float, ...]
    turn: float
    end: float


TASKS = tuple(
    (scenario, law) for scenario in ("smooth", "massive", "tumbling") for law in ("nmpc", "balancer")
)
WEIGHTS = tuple(Case(SHIPPED, weight, 0.02) for weight in (0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7))
ROOM = (
    *(Case(EARLIER, weight, 0.0) for weight in (0.0, 1e3, 1e5, 1e6, 1e7)),
    *(Case(EARLIER, 1e7, apart) for apart in (0.05, 0.1, 0.15)),
    Case(EARLIER, 1e7, 0.05, rate_limit=0.1),
)


def outcome_of(case: Case) -> Outcome:
    """Return the figures of a run."""
    scenario = load_scenario(
        case.scenario,
        {
            "common": {"duration": SECONDS, "tick": TICK, "on_touch": "report"},
            "trajectory.time_law": "quintic",
            "law": "balancer",
            "controller": {
                "base_turn_weight": case.weight,
                "keep_apart": case.keep_apart,
                "arm_rate_limit": case.rate_limit,
            },
        },
    )
    run, robot = simulate(scenario), scenario.truth.robot
    clearance = run_clearance(run, TaskTexts(robot.urdf, scenario.truth.schedule.text))
    others = [item.least for item in clearance.groups if IDLE in item.group and "itself" not in item.group]
    apart = run.tool_pose[WORKS][:, :3] - run.target_pose[WORKS][:, :3]
    return Outcome(
        float(np.linalg.norm(base_rotation(run).values, axis=1).max()) * DEG_PER_RAD,
        float(base_turn_rate(run).values.max()) * DEG_PER_RAD,
        float(np.linalg.norm(apart, axis=1).max()) * MM_PER_M,
        run.grasp_events[0].position_error * MM_PER_M,
        float(np.abs(run.joint_velocity[:, robot.arm_joints[IDLE]]).max()),
        min(others) * MM_PER_M,
        tuple(sorted({row for plan in run.plans for row in plan.active if IDLE in row})),
    )


def task_of(scenario: str, law: str) -> Task:
    """Return what comes of a whole task under a law as it is shipped."""
    run = simulate(load_scenario(scenario, {"common.tick": TICK, "law": law}))
    turns = np.linalg.norm(base_rotation(run).values, axis=1) * DEG_PER_RAD
    grasps = tuple(event.position_error * MM_PER_M for event in run.grasp_events)
    return Task(grasps, float(turns.max()), float(turns[-1]))


def section(found: Mapping[Case, Outcome], tasks: Mapping[tuple[str, str], Task]) -> str:
    """Return the text of the section."""
    figures = ("Turn [deg]", "Turn rate [deg/s]", "Tool [mm]", "Grasp [mm]", "Rate of B [rad/s]", "B [mm]")
    weights = [(case.name, *_cells(found[case])) for case in WEIGHTS]
    room = [
        (case.name, f"{case.keep_apart * MM_PER_M:.0f}", *_cells(found[case]), _bodies(found[case].active))
        for case in ROOM
    ]
    held, best = (min(found[case].turn for case in WEIGHTS if test(case)) for test in (_holds, _balances))
    whole = [
        (*key, ", ".join(f"{mm:.2g}" for mm in task.grasps), f"{task.turn:.2f}", f"{task.end:.2f}")
        for key, task in tasks.items()
    ]
    return f"""\
This section is written by `make balancer`: the first {SECONDS:.0f} s, in which arm A goes to the deputy and
grasps it and arm B is idle, at a tick of {TICK * 1e3:g} ms. Turn and turn rate are the largest of the base,
tool is the largest error of the working tool on its way, grasp its error at the grasp, rate the largest joint
rate of arm B, and the last column how near arm B came to anything else.

![Base turn against tool error, and against clearance](images/balancer.svg)

Scenario `{SHIPPED}`, `keep_apart` of 20 mm. With the idle arm held the base turns by {held:.2f} degrees, with
the balancer by down to {best:.3f}:

{table(("Arm B", *figures), weights)}

Scenario `{EARLIER}` with smooth targets, the geometry in which an earlier prototype was measured; the
gripper of A keeps 1 mm from the deputy, where the grasp frame is on its face, hence the error at the grasp:

{table(("Arm B", "Apart [mm]", *figures, "B is kept from"), room)}

Whole tasks, with the parameters that the law has by itself:

{table(("Scenario", "Law", "Grasp, transfer [mm]", "Farthest turn [deg]", "Turn at the end [deg]"), whole)}
"""


def with_section(page: str, text: str) -> str:
    """Return a page with another text in the section that is written here."""
    begin = page.index(_HEAD) + len(_HEAD)
    return f"{page[:begin]}\n{text}\n{page[page.index(_NEXT, begin) :]}"


def _holds(case: Case) -> bool:
    return case.weight == 0.0


def _balances(case: Case) -> bool:
    return case.weight > 0.0


def _cells(outcome: Outcome) -> tuple[str, ...]:
    """Return the figures of an outcome as text."""
    first = (f"{outcome.turn:.3f}", f"{outcome.turn_rate:.3f}", f"{outcome.tool:.2g}", f"{outcome.grasp:.2g}")
    return (*first, f"{outcome.rate:.3f}", f"{round(outcome.least, 1) + 0.0:.1f}")  # no -0.0


def _bodies(active: tuple[str, ...]) -> str:
    """Return what an arm was kept from, as text."""
    pairs = [row.removeprefix("distance ").split(" - ") for row in active if row.startswith("distance ")]
    return ", ".join(sorted({body for pair in pairs for body in pair if IDLE not in body})) or "-"


def draw(found: Mapping[Case, Outcome], file: Path) -> None:
    """Draw the two fronts."""
    matplotlib.rcParams.update({"svg.hashsalt": "sms_handover", "svg.fonttype": "none"})
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    left.plot(
        [found[case].turn for case in WEIGHTS], [found[case].tool for case in WEIGHTS], "o-", color="#0072b2"
    )
    for index, case in enumerate(WEIGHTS):
        name = f"{case.weight:.0e}" if case.weight else "held"
        shift = (0, -14) if index % 2 else (0, 7)
        point = found[case].turn, found[case].tool
        left.annotate(name, point, shift, textcoords="offset points", ha="center")
    left.margins(0.12)
    left.set_xlabel("largest turn of the base [deg]")
    left.set_ylabel("largest tool error [mm]")
    left.set_title(f"{SHIPPED}, by weight")
    free = [case for case in ROOM if case.keep_apart == 0.0]
    most = max(case.weight for case in ROOM)
    kept = [case for case in ROOM if case.weight == most and not case.rate_limit]
    for cases, label, color in (
        (free, "by weight, keep_apart 0", "#0072b2"),
        (kept, "weight 1e7, keep_apart 0 to 0.15 m", "#d55e00"),
    ):
        ordered = sorted(cases, key=lambda case: found[case].turn)
        turns, least = ([getattr(found[case], name) for case in ordered] for name in ("turn", "least"))
        right.plot(turns, least, "o-", label=label, color=color)
    right.set_xlabel("largest turn of the base [deg]")
    right.set_ylabel("least distance of arm B [mm]")
    right.set_title(EARLIER)
    right.legend()
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


def measured() -> dict[Case, Outcome]:
    """Run all cases, which are the first phases alone."""
    found = dict[Case, Outcome]()
    for case in (*WEIGHTS, *ROOM):
        found[case] = outcome_of(case)
        print(case, found[case], flush=True)
    return found


def main() -> None:
    """Run all cases and write page and picture."""
    found = measured()
    tasks = {key: task_of(*key) for key in TASKS}
    draw(found, PICTURE)
    PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), section(found, tasks)), encoding="utf-8")
    print(f"{PAGE.name} written")


if __name__ == "__main__":
    main()
