"""Clearance page: how near bodies come to each other in the shipped scenarios, under each law."""

from pathlib import Path

from docs.tables import table
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.metrics import RunMetrics, measure
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

_WHEN = [
    (
        "before",
        "`check` and `run` simulate the run in one process with the law, dynamics and model of the "
        "scenario: seconds. "
        "`--no-dry-run` leaves it out; a controller of your own has none",
        "a warning with bodies, time and depth; with `--reject-collisions` exit code 2, nothing is started",
    ),
    (
        "during",
        "`common.clearance: online`: the plant measures each reference period and publishes "
        "[`clearance`](topics.md)",
        "an event `collision` when it begins, a warning",
    ),
    (
        "during",
        "`common.on_collision: abort`, which sets the above",
        "the phase has failed one period later: [the joints are held]"
        "(watchdogs.md#a-phase-that-has-failed), the run ends with exit code 1, its bag is complete",
    ),
    (
        "after",
        "`simulate`, `compare`, `report`, from the recorded states: each reference period, and each tick "
        "around the least distance of a group",
        "rows in their tables; `simulate` warns, with `--reject-collisions` its exit code is 1",
    ),
]

RUNS = (
    *((scenario, law) for scenario in ("paper", "smooth", "colliding") for law in (NMPC.name, PID.name)),
    *((scenario, NMPC.name) for scenario in ("massive", "tumbling")),  # PID is unstable with that mass
)
PAGE = Path(__file__).resolve().parent / "clearance.md"


def clearance_page() -> str:
    """Return the page; runs the handovers of two Gen3 arms, which takes minutes."""
    runs = {f"{scenario}, {law}": _measured(scenario, law) for scenario, law in RUNS}
    groups: dict[str, dict[str, str]] = {}
    for name, run in runs.items():
        assert run.clearance is not None
        for group in run.clearance.groups:
            mark = "**" if group.collides else ""
            distance, time = group.least * MM_PER_M, ns_to_seconds(group.stamp_ns)
            groups.setdefault(group.group, {})[name] = f"{mark}{distance:.2f}{mark} ({time:.2f} s)"
    distances = [(group, *(cells.get(name, "-") for name in runs)) for group, cells in groups.items()]
    rates, positions = [], []
    for run in runs.values():
        assert run.limits is not None
        rates.append(f"{100.0 * run.limits.rate.value:.0f} ({run.limits.rate.joint})")
        positions.append(f"{run.limits.position.value * DEG_PER_RAD:.2f} ({run.limits.position.joint})")
    limits = [
        ("largest rate [% of its limit]", *rates),
        ("farthest past a position limit [deg]", *positions),
    ]
    return f"""\
# Clearance

This page is written by `make clearance` from runs in one process. [Metrics](metrics.md) defines the
figures; `compare`, `report` and `simulate` show them for every run, from the robot description and the
schedule in its bag.

Every rigid body of robot and deputy counts: the spacecraft, its panels, links and grippers as the
description draws them or [gives their solids](configuration.md#solids-and-pairs-for-clearance), and the
deputy as a box. Not counted are pairs that no joint moves against each other, neighbours along an arm, and
pairs that touch at each of 200 random configurations; a robot file can allow more pairs, or count them.
Pairs that touch at none of these configurations are counted: samples do not prove that they never will.
Distances are signed, by coal through Pinocchio, depend on the configuration alone to the last bit, and agree
with closed forms (`test/core/test_clearance.py`) and with MuJoCo ([verification](verification.md)).

Contact of gripper and deputy is **declared** from the phase on in which the arm goes to a grasp frame, or
from its grasp, until it has let go and the two have come apart. It may be `common.contact_depth` (1 mm) deep.

## Before, during and after a run

{table(("When", "How", "Collision"), _WHEN)}

`simulate` is its own dry run. With `report`, the default, a collision changes no exit code: the scenario
`colliding` is there to be run. Online a contact that begins and ends between two reference periods is
missed; after the run it is found. Measuring changes no bit of a run, and the distances over DDS are those in
one process (`test/system/test_equality.py`). The restarts of inverse kinematics by which a schedule is
checked begin at configurations without overlaps; about a third of random ones have some.

## Least distances in the shipped scenarios

Signed distance in mm and when it was; **bold** is a collision: less than zero, or less than -1 mm where
contact of gripper and deputy is declared: "contact". The columns are [scenario](scenarios.md) and control
law.

{table(["Bodies", *runs], distances)}

In `paper` and `smooth` no body enters another, under either law, nor in `massive` and `tumbling`, which PID
[cannot carry](deputy_with_mass.md). `colliding` is the geometry of the first
edition: under step targets both laws press a gripper into the deputy, and under PID the grippers pass through
each other and joints turn faster than they can. There are no contact forces, so such a run goes on; `compare`
says that it is not complete, and of the paper's claims *completion* does not hold.

## Limits of the joints

{table(["Figure", *runs], limits)}

Position and rate limits are reported, not enforced, unless `plant.joint_limits` is `enforce`
([dynamics.md](dynamics.md)). A negative position is the distance from the nearest limit.
"""


def _measured(name: str, law: str) -> RunMetrics:
    scenario = load_scenario(name, {"law": law})
    texts = TaskTexts(scenario.truth.robot.urdf, scenario.truth.schedule.text)
    return measure(simulate(scenario), texts=texts)


if __name__ == "__main__":
    PAGE.write_text(clearance_page(), encoding="utf-8")
    print(f"{PAGE.name} written")
