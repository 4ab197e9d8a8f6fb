"""A grasp that misses in a run over DDS: retried, given up, recorded, reproduced, told by the exit code."""

from pathlib import Path

import pytest
import yaml

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.run.reader import read_run
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from ..ros.short_handover import short_handover
from .conftest import Command
from .runs import sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]


def test_a_run_with_retries_is_the_one_in_one_process(tmp_path: Path, called: Command) -> None:
    """The end of the run moves twice, and then comes early; the bag is whole and reproduces."""
    schedule = yaml.safe_load(short_handover(deputy_off=(0.02, 0.0, 0.0)))
    schedule["phases"][1]["on_miss"] = {"retry": 2}
    path = tmp_path / "schedule.yaml"
    path.write_text(yaml.safe_dump(schedule, sort_keys=False), encoding="utf-8")
    hold = ("--time-law", "step", "-p", "trajectory.failure_hold:=0.06")
    ended = sms_handover("run", "--schedule", path, *hold, "-o", "out", cwd=tmp_path)
    assert ended.code == 4, ended
    assert "phase_retried" in ended.err and "grasp_failed" in ended.err
    assert "the nodes reported 1 error, 2 warnings, see above" in ended.out
    assert "phase 'carry' has failed at 0.42 s of simulated time" in ended.out
    recorded = read_run(tmp_path / "out" / "bag")
    scenario = load_scenario("colliding", {"common.schedule": str(path), "trajectory.failure_hold": 0.06})
    assert compare_runs(recorded, simulate(scenario)) == ()
    assert [event.kind for event in recorded.run_events if event.node == "trajectory"] == [
        "phase_retried",
        "phase_retried",
        "grasp_failed",
    ]
    for command in (("verify", "out"), ("bag", "check", "out")):
        again = called(*command, cwd=tmp_path)
        assert again.code == 0, again
    alone = called("simulate", "--schedule", path, *hold, cwd=tmp_path)
    assert alone.code == 4 and "grasp_failed" in alone.out
