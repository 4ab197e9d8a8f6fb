"""The tutorials do what they say: their schedule runs, and its mistakes are told in the words they show."""

import re
from pathlib import Path

import pytest

from sms_handover.errors import SmsHandoverError
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus

from .documents import blocks
from .workspace import ROOT

PAGE = ROOT / "docs" / "tutorial_schedule.md"
SCHEDULE = next(block.text for block in blocks(PAGE) if block.language == "yaml")
MISTAKES = {
    "out of reach": (r"0\.45, 0\.2\]", "1.9, 0.2]"),
    "off the reference period": (r"duration: 10\.0", "duration: 10.01"),
    "unknown grasp frame": (r"(grasp_frame: end_)a\}\n", r"\1q}\n"),
}


def scenario_of(text: str, folder: Path) -> Scenario:
    """Return what `simulate --schedule my_task.yaml --time-law quintic` runs."""
    file = folder / "my_task.yaml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(values={"common": {"schedule": str(file)}, "trajectory": {"time_law": "quintic"}})


def test_the_schedule_of_the_tutorial_runs(tmp_path: Path) -> None:
    scenario = scenario_of(SCHEDULE, tmp_path)
    check_scenario(scenario)
    events = simulate(scenario).grasp_events
    assert [event.status for event in events] == [GraspStatus.SUCCEEDED] * 2
    assert [event.stamp_ns for event in events] == [15_000_000_000, 30_000_000_000]


@pytest.mark.parametrize(("pattern", "wrong"), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_are_told_as_the_tutorial_shows(pattern: str, wrong: str, tmp_path: Path) -> None:
    changed, count = re.subn(pattern, wrong, SCHEDULE, count=1)
    assert count == 1
    with pytest.raises(SmsHandoverError) as told:
        check_scenario(scenario_of(changed, tmp_path))
    assert str(told.value).replace(f"{tmp_path}/", "") in PAGE.read_text(encoding="utf-8")
