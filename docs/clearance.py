"""Clearance page: how near the bodies of the shipped handover come to each other, under each law."""

from pathlib import Path

from docs.tables import table
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.metrics import RunMetrics, measure
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.trajectory.time_law import TIME_LAWS
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

PAGE = Path(__file__).resolve().parent / "clearance.md"


def clearance_page() -> str:
    """Return the page; runs the shipped handover under every law and time law, which takes about a minute."""
    runs = {
        f"{law}, {time_law}": _measured(law, time_law)
        for law in (NMPC.name, PID.name)
        for time_law in TIME_LAWS
    }
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
description draws them, and the deputy as a box. Not counted are pairs that no joint moves against each
other, neighbours along an arm, and pairs that touch whatever the joint angles. Distances are signed, by
coal through Pinocchio, and agree with closed forms (`test/core/test_clearance.py`) and with MuJoCo
([verification](verification.md)).

## Least distance in the shipped handover

Signed distance in mm and when it was; **bold** is a collision: less than zero, or less than -1 mm where
contact of gripper and deputy is declared: "contact". The columns are control law and time law.

{table(["Bodies", *runs], distances)}

**The shipped task collides.** Under step targets both laws press a gripper into the deputy, and under PID
the grippers pass through each other. The simulation has no contact forces, so the run goes on and the
paper's claims are judged as if nothing had touched; read them with this table beside them. With smooth
(quintic) targets the grippers stay 140 mm apart; what is left is that arm A stands in the way while arm B
pulls the deputy past it.

## Limits of the joints

{table(["Figure", *runs], limits)}

Position and rate limits are reported, not enforced: the plant has no joint stops, and its motors no
torque-speed line. A negative position is the distance from the nearest limit.
"""


def _measured(law: str, time_law: str) -> RunMetrics:
    scenario = load_scenario(values={"controller": {"law": law}, "trajectory": {"time_law": time_law}})
    return measure(
        simulate(scenario), texts=TaskTexts(scenario.truth.robot.urdf, scenario.truth.schedule.text)
    )


if __name__ == "__main__":
    PAGE.write_text(clearance_page(), encoding="utf-8")
    print(f"{PAGE.name} written")
