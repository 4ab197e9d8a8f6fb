"""A schedule of any length: after the shipped handover the deputy keeps changing hands."""

from pathlib import Path
from typing import Any

import yaml

from sms_handover.configuration.package_files import config_file

_PHASE_S = 15.0  # [s] of a phase in which the arms meet or part
_MOTION_S = 11.0  # [s] of it in motion
_SHIPPED_S = 60.0  # [s] of the shipped schedule
_ASIDE, _MEETING = 0.42, 0.12  # [m] along y of the tools where they wait, and where they hand over
_ROLLING_PERIOD_S = 2.0  # [s] of NMPC with the deputy held, as in the shipped schedule
_TO = {"arm_a": ("arm_b", "end_a", 1.0), "arm_b": ("arm_a", "end_b", -1.0)}  # from whom, what end, side


def long_schedule(end_s: float) -> str:
    """Return the text of a schedule of at least so many seconds, with two handovers a minute."""
    schedule: dict[str, Any] = yaml.safe_load(
        config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
    )
    phases, start_s, number = schedule["phases"], _SHIPPED_S, 0
    while start_s < end_s:
        taker = ("arm_a", "arm_b")[number % 2]
        giver, frame, side = _TO[taker]
        number += 1
        together = {"arm_a": _pose(1.18, _MEETING), "arm_b": _pose(1.18, -_MEETING)}
        phases.append(_phase(f"meet_{number}", start_s, together))
        apart = {taker: _pose(1.15, side * _ASIDE), giver: "hold"}
        transfer = [{"transfer": {"from": giver, "to": taker, "grasp_frame": frame}}]
        phases.append({**_phase(f"part_{number}", start_s + _PHASE_S, apart), "events": transfer})
        start_s += 2 * _PHASE_S
    return str(yaml.safe_dump(schedule, sort_keys=False))


def write_schedule(path: Path, end_s: float) -> Path:
    """Write the schedule to a file and return its path."""
    path.write_text(long_schedule(end_s), encoding="utf-8")
    return path


def _phase(name: str, start_s: float, arms: dict[str, Any]) -> dict[str, Any]:
    """Return one phase."""
    gains = {"nmpc": {"rolling_period": _ROLLING_PERIOD_S}}
    return {
        "name": name,
        "start": start_s,
        "duration": _PHASE_S,
        "motion": _MOTION_S,
        "arms": arms,
        "gains": gains,
    }


def _pose(x: float, y: float) -> dict[str, Any]:
    """Return a target of a tool in the world [m], the gripper along +x as in the shipped schedule."""
    rpy = [3.141592653589793, -1.5707963267948966, 0.0]  # [rad]
    return {"tool_in_world": {"xyz": [x, y, 0.4], "rpy": rpy}}
