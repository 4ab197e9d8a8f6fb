"""Engines compared: how fast each runs the handover, and how precise it is for the work."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.contestants import InDrake, InMujoco, Ours
from benchmarks.handover_task import Contestant, HandoverTask, State
from benchmarks.machine import versions
from benchmarks.results import DIAGRAMS, Result, Table, publish, row
from benchmarks.states import apart
from sms_handover.model.conserved import conserved_quantities
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.run_data import RunData
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.parameters import COMPILED, PINOCCHIO
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate

ROUNDS = 3  # of the whole handover
DIAGRAM = "work_precision.svg"
REFERENCE_STEPS = 4  # per tick: what is then left of the error is rounding
EULER = Tableau(1, ((),), (0,), ((1.0,),))
KUTTA = Tableau(3, ((), (1 / 3,), (0.0, 2 / 3)), (0, 0, 0), ((1 / 3, 0.0, 0.0), (-1 / 12, 0.0, 3 / 4)))
OURS = {PINOCCHIO: "ours", COMPILED: "ours, compiled"}
Point = tuple[float, float, str]  # us per tick, error in rad, name
_MARKS = {
    "ours": ("o", 4),
    "ours, compiled": ("D", 4),
    "MuJoCo": ("s", -11),
    "Drake": ("^", 4),
}  # and how far up the labels stand, points


@dataclass(frozen=True)
class Case:
    """One engine with one integrator and a number of steps per tick."""

    engine: str
    scheme: str
    steps: int
    make: Callable[[HandoverTask], Contestant]

    @property
    def name(self) -> str:
        """Who it is, for tables."""
        return f"{self.engine}, {self.scheme}" + (f", {self.steps} steps per tick" if self.steps > 1 else "")


@dataclass
class Course:
    """How a case went through the task: wall time per reference period in s, and its states on the way."""

    seconds: list[float]
    states: list[State]


def cases() -> list[Case]:
    """Return who takes part; the first is the shipped one."""
    ours = [
        ("order 4 (rk4)", TABLEAUS["rk4"], 1),
        ("order 3", KUTTA, 1),
        ("order 2 (midpoint)", TABLEAUS["midpoint"], 1),
        ("order 2 (midpoint)", TABLEAUS["midpoint"], 4),
        ("order 1 (Euler)", EULER, 1),
    ]
    in_mujoco = [("RK4", 1), ("EULER", 1), ("EULER", 4)]
    in_drake = [("runge_kutta3", 1), ("runge_kutta5", 1), ("semi_explicit_euler", 1)]
    return [
        *(
            Case(engine, name, n, partial(Ours, tableau=tableau, dynamics=dynamics, steps=n))
            for dynamics, engine in OURS.items()
            for name, tableau, n in ours
        ),
        *(Case("MuJoCo", name, n, partial(InMujoco, integrator=name, steps=n)) for name, n in in_mujoco),
        *(Case("Drake", name, n, partial(InDrake, scheme=name, steps=n)) for name, n in in_drake),
    ]


def race(task: HandoverTask, contestants: Mapping[str, Contestant]) -> dict[str, Course]:
    """Let all go through the task, taking turns each reference period."""
    courses = {name: Course([], [task.start]) for name in contestants}
    for index in range(len(task.references) - 1):  # the last one is only answered
        for name, contestant in contestants.items():
            start = perf_counter()
            contestant.period(index)
            courses[name].seconds.append(perf_counter() - start)
            courses[name].states.append(contestant.state)
    return courses


def undisturbed(course: Course) -> float:
    """Return the time in s that a tenth of the periods stayed below: others hardly lengthen it."""
    return float(np.percentile(course.seconds, 10))


def precision(task: HandoverTask, course: Course, exact: Course) -> tuple[float, float, float]:
    """Return the largest error of the joints in rad and of the base in m or rad, and the momentum gained."""
    errors = np.array([apart(a, b) for a, b in zip(course.states, exact.states, strict=True)])
    momenta = [
        conserved_quantities(task.scenario.truth.robot, *state).angular_momentum
        for state in course.states[::10]
    ]
    return float(errors[:, 0].max()), float(errors[:, 1:].max()), float(np.linalg.norm(momenta, axis=1).max())


def draw(points: Mapping[str, list[Point]]) -> None:
    """Draw wall time per tick against the error of the joints."""
    figure, axes = plt.subplots(figsize=(7.0, 4.5))
    for engine, found in points.items():
        mark, height = _MARKS[engine]
        axes.loglog([x for x, _, _ in found], [y for _, y, _ in found], mark, label=engine)
        for x, y, name in found:
            axes.annotate(name, (x, y), textcoords="offset points", xytext=(5, height), fontsize=7)
    axes.set(
        xlabel="wall time per tick of 1 ms, loop included [us]",
        ylabel="largest error of a joint in 60 s [rad]",
    )
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(loc="center right", bbox_to_anchor=(1.0, 0.7))  # where no label is
    DIAGRAMS.mkdir(parents=True, exist_ok=True)
    figure.savefig(DIAGRAMS / DIAGRAM, metadata={"Date": None}, bbox_inches="tight")


def compare(
    task: HandoverTask, every: Sequence[Case], courses: Mapping[str, Course]
) -> tuple[Table, dict[str, list[Point]]]:
    """Return the table, and the points of the diagram by engine."""
    rows, points = [], defaultdict(list)
    ours = undisturbed(courses[every[0].name])
    for case in every:
        course = courses[case.name]
        seconds = undisturbed(course)
        per_tick = seconds / task.scenario.parameters.common.ticks_per_reference
        errors = precision(task, course, courses["exact"])
        shown = (f"{error:.1e}" for error in errors)
        rows.append(row(case.name, 1e6 * per_tick, task.tick_s / per_tick, seconds / ours, *shown))
        points[case.engine].append((1e6 * per_tick, errors[0], f"{case.scheme} x{case.steps}"))
    heading = ("engine and integrator", "us per tick", "x real time", "time over ours", "joints [rad]",
               "base [m, rad]", "angular momentum [kg m^2/s]")  # fmt: skip
    return Table(heading, rows), dict(points)


def timed(scenario: Scenario) -> tuple[RunData, float]:
    """Return the run of a scenario, and the least wall time in s that it took."""
    seconds = []
    for _ in range(ROUNDS):
        start = perf_counter()
        run = simulate(scenario)
        seconds.append(perf_counter() - start)
    return run, min(seconds)


def main() -> None:
    """Measure and publish."""
    matplotlib.rcParams.update({"svg.hashsalt": "sms_handover", "svg.fonttype": "none"})
    scenario = load_scenario("paper", {"controller": {"law": "nmpc"}})
    compiled = load_scenario("paper", {"controller": {"law": "nmpc"}, "common": {"dynamics": COMPILED}})
    check_scenario(compiled)  # which makes the library
    run, whole = timed(scenario)
    _, whole_compiled = timed(compiled)
    simulated = float(run.tick_ns[-1]) * 1e-9
    task = HandoverTask.of(scenario, run)
    every = cases()
    contestants = {
        "exact": Ours(task, TABLEAUS["rk4"], PINOCCHIO, REFERENCE_STEPS),
        **{c.name: c.make(task) for c in every},
    }
    courses = race(task, contestants)
    table, points = compare(task, every, courses)
    draw(points)
    publish(
        Result(
            name="engines",
            question="How fast, and how precise, against other engines?",
            notes=[
                "The 60 s handover under NMPC: the same robot, references, gains and tick of 1 ms, and the "
                "law with the engine's own H and c, in a loop in Python. All took turns every 20 ms of "
                "simulated time; times are what a tenth of these turns stayed below. Errors are the largest "
                f"over the run, against ours with {REFERENCE_STEPS} steps of order 4 per tick. The run "
                "starts at rest, so all momentum is error. "
                f"Compared: {versions(('pin', 'mujoco', 'drake'))}.",
                "`simulate` with everything (inverse kinematics, trajectory, record), the best of "
                f"{ROUNDS} runs of {simulated:g} s of simulated time: {whole:.2f} s, {simulated / whole:.1f} "
                f"times real time; with compiled dynamics {whole_compiled:.2f} s, "
                f"{simulated / whole_compiled:.1f} times real time.",
            ],
            tables=[table],
            diagrams=[DIAGRAM],
            values={"simulate_s": whole, "simulate_compiled_s": whole_compiled, "points": points},
        )
    )


if __name__ == "__main__":
    main()
