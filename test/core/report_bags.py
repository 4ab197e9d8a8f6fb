"""Short handovers under both laws, in bags that carry what those of a run over DDS carry."""

from collections.abc import Mapping
from pathlib import Path

from sms_handover.bag.recording import Recording
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from ..ros.short_handover import short_handover
from .bag_messages import TYPES, open_topics, record_run

LAWS = ("nmpc", "pid")
STRETCH = 3.0  # [-] of the short schedule: about one second
PLANT = {"grasp_position_tolerance": 0.01, "grasp_angle_tolerance": 0.035, "grasp_speed_tolerance": 0.02}

Parameters = Mapping[str, Mapping[str, object]]


def parameters(law: str) -> dict[str, dict[str, object]]:
    """Return parameters as two nodes would record them, some shared by both."""
    shared: dict[str, object] = {"tick": 0.001, "mode": "lockstep"}
    return {
        "controller": {**shared, "law": law, "rolling_period": 1.0},
        "plant": {**shared, **PLANT, "integrator": "rk4"},
    }


def write_bag(
    folder: Path,
    run: RunData,
    *,
    urdf: str | None,
    schedule: str | None,
    values: Parameters | None,
    origin: Mapping[str, str] | None = None,
) -> Path:
    """Write the bag of a run with the files and records given, and return its folder."""
    with Recording(folder, types=TYPES) as recording:
        recording.describe(urdf=urdf, schedule=schedule, parameters=values, provenance=origin)
        open_topics(recording, arms=run.arms)
        record_run(recording, run)
    return folder


def write_handovers(folder: Path) -> dict[str, Path]:
    """Simulate a short handover under each law and return the folders of its bags by law."""
    schedule = folder / "short.yaml"
    text = short_handover(stretch=STRETCH)
    schedule.write_text(text, encoding="utf-8")
    bags = {}
    for law in LAWS:
        scenario = load_scenario(
            "colliding", {"common": {"schedule": str(schedule)}, "controller": {"law": law}}
        )
        bags[law] = write_bag(
            folder / law,
            simulate(scenario),
            urdf=scenario.truth.robot.urdf,
            schedule=text,
            values=parameters(law),
            origin={"start": "2026-01-02T03:04:05.678+00:00", "seed": "none", "version.numpy": "2.4.6"},
        )
    return bags
