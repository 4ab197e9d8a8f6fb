"""A handover of 1.8 s whose first grasp misses, is tried again and succeeds under NMPC."""

from pathlib import Path

from sms_handover.simulation.scenario import Overrides

from .conftest import SCHEDULE

TICKS = 1_821  # of the run
EARLIEST_END = 1_400  # ticks of a run without the retry
MISSED = (401, 421)  # ticks at which a grasp has been commanded, but its event is not yet known
LAWS: dict[str, dict[str, object]] = {"nmpc": {"rolling_period": 0.3}, "pid": {"law": "pid"}}


def retried_handover(folder: Path) -> Overrides:
    """Return the values of its scenario, with the schedule in a file in ``folder``."""
    schedule = folder / "schedule.yaml"
    text = SCHEDULE.replace("  - name: carry\n", "  - name: carry\n    on_miss: {retry: 1}\n")
    schedule.write_text(text, encoding="utf-8")
    return {"common": {"schedule": str(schedule)}, "trajectory": {"time_law": "quintic"}}
