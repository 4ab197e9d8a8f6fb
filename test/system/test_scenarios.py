"""A scenario with a robot of its own goes through the graph and through every command that reads a run."""

from pathlib import Path

import pytest

from .conftest import Command
from .runs import sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]


def test_the_planar_scenario_is_run_recorded_reproduced_compared_reported_and_viewed(
    tmp_path: Path, called: Command
) -> None:
    """The beginning of it: two joints per arm, a shorter run than the schedule, and no inverse kinematics."""
    ended = sms_handover("run", "planar", "-p", "common.duration:=0.2", "-o", "planar", cwd=tmp_path)
    assert ended.code == 0, ended
    assert "run complete at 0.2 s of simulated time" in ended.out
    for command in (
        ("verify", "planar"),
        ("compare", "planar"),
        ("report", "planar", "-o", "report"),
        ("view", "planar", "-o", "page.html", "--no-browser"),
    ):
        ended = called(*command, cwd=tmp_path)
        assert ended.code == 0, ended
    assert "Joint torques of arm_b" in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "<title>Handover: planar</title>" in (tmp_path / "page.html").read_text(encoding="utf-8")
