"""Clearance: what the distances of all bodies cost, in one call of Pinocchio and pair by pair."""

from statistics import median
from time import perf_counter

import numpy as np
import pinocchio as pin

from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import interleaved
from sms_handover.clearance.allowed_pairs import counted_pairs
from sms_handover.clearance.solids import read_solids
from sms_handover.model.shapes import ContactPairs
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import make_clearance, make_monitor
from sms_handover.types import Array

STEP, COUNT = 10, 60  # ticks between two configurations of the handover, and how many there are
ROUNDS = 10
BUDGET_US = 120.0  # us, the median over the configurations


def main() -> None:
    """Measure and publish."""
    scenario = load_scenario("paper")
    robot, schedule = scenario.truth.robot, scenario.truth.schedule
    poses, loop = list[Array](), Loop(scenario)
    while len(poses) < COUNT:
        tick = loop.advance()
        if tick.stamp_ns % (STEP * scenario.parameters.common.tick_ns) == 0:
            poses.append(tick.q)
    deputy = schedule.deputy.deputy_in_world
    model = make_clearance(robot, schedule)
    monitor = make_monitor(robot, schedule, scenario.parameters.common)
    geometry = read_solids(robot.pin, robot.urdf)
    pairs = counted_pairs(robot.pin, geometry, ContactPairs())
    for pair in pairs:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    results = pin.GeometryData(geometry)

    def pair_by_pair() -> None:
        for q in poses:
            pin.updateGeometryPlacements(robot.pin, robot.data, geometry, results, q)
            for index in range(len(pairs)):
                pin.computeDistance(geometry, results, index)

    def with_groups() -> None:
        for q in poses:
            monitor.measure(0, q, deputy, 0, "")

    calls: list[float] = []

    def in_one_call() -> None:
        for q in poses:
            begin = perf_counter()
            model.distances(q, deputy)
            calls.append(perf_counter() - begin)

    runs = {
        f"distances of {len(model.pairs)} pairs, one call": in_one_call,
        "the same, with groups and nearest points": lambda: [
            monitor.measure(0, q, deputy, 0, "") for q in poses
        ],
        f"{len(pairs)} pairs without the deputy, one by one from Python": pair_by_pair,
    }
    times = interleaved(runs, ROUNDS)
    first = next(iter(runs))
    rows = [row(name, 1e6 * times.best(name) / COUNT, times.ratio(name, first)) for name in runs]
    middle = 1e6 * float(np.min([median(calls[k : k + COUNT]) for k in range(COUNT, len(calls), COUNT)]))
    publish(
        Result(
            name="clearance",
            question="What does it cost to know how near all bodies are?",
            notes=[
                f"At {COUNT} configurations of the shipped handover, {STEP} ticks apart. All took turns; the "
                "shortest time counts. In a run it is once per reference period of 20 ms. The median call of "
                f"the best round took {middle:.0f} us, the budget is {BUDGET_US:.0f} us."
            ],
            tables=[Table(("contestant", "us per configuration", "time over one call"), rows)],
            values={"median_us": middle, "budget_us": BUDGET_US},
        )
    )


if __name__ == "__main__":
    main()
