"""Small campaigns for tests: files, folders, and the rows that came of them."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from sms_handover.campaign.cases.case_process import CASE_PROGRAM, Done
from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.definition.frozen import Frozen, freeze
from sms_handover.campaign.engine.run import Tally, run_campaign
from sms_handover.campaign.engine.workers import SerialWorkers
from sms_handover.campaign.record.campaign_folder import CampaignFolder, open_campaign
from sms_handover.campaign.record.manifest import Shard

WHOLE = Shard()
MASS = "truth.robot.base.mass"
STUB = (sys.executable, str(Path(__file__).with_name("stub_cases.py")))
TINY: Mapping[str, Any] = {
    "name": "tiny",
    "seed": 3,
    "cases": 4,
    "scenarios": {"smooth": "smooth"},
    "laws": ["nmpc"],
    "values": {"common.duration": 0.04},
    "draws": {MASS: {"normal": {"mean": 240, "std": 12}}},
    "success": "peak_torque < 30",
}


def written(folder: Path, **changes: Any) -> Path:
    """Write a campaign file; a change to None leaves a key out."""
    content = {key: value for key, value in {**TINY, **changes}.items() if value is not None}
    path = folder / "campaign.yaml"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def run_here(
    file: Path,
    folder: Path,
    cases: int | None = None,
    shard: Shard = WHOLE,
    program: Sequence[str] = CASE_PROGRAM,
) -> Tally:
    """Run a campaign with one process; ``cases`` in place of those of the file."""
    frozen, number = freeze(file)
    number = number if cases is None else cases
    with open_campaign(folder, frozen, number, shard) as opened:
        workers = lambda: SerialWorkers(frozen, number, program)  # noqa: E731
        return run_campaign(opened, workers, lambda tally: None)


def rows_of(folder: Path) -> dict[Task, Row]:
    """Return the rows of a folder."""
    return {entry.row.task: entry.row for entry in CampaignFolder(folder).entries()}


def digests_of(folder: Path) -> dict[Task, str]:
    """Return the digests of the rows of a folder."""
    return {task: row.digest for task, row in sorted(rows_of(folder).items())}


def command(*words: str, **options: Any) -> "subprocess.Popen[str]":
    """Start a verb of the command line as a process of its own."""
    return subprocess.Popen([sys.executable, "-m", "sms_handover.cli.main", *words], text=True, **options)


def made_up(case: int, trajectory: bytes = b"") -> Done:
    """Return a finished case that nobody ran."""
    row = Row(Task(case, "smooth", "nmpc"), case, {"x": 0.1 * case}, Status.SUCCEEDED, "", {"y": 1e-3}, "00")
    return Done(row, Beside(0.0, 0.1, "nowhere"), trajectory)


def begun(path: Path, cases: Sequence[int] = range(6), shard: Shard = WHOLE) -> Frozen:
    """Make a folder of a campaign of six cases with rows of some; return the campaign."""
    frozen, number = freeze(written(path.parent / "file", cases=6))
    with open_campaign(path, frozen, number, shard) as opened:
        opened.add(*map(made_up, cases))
    return frozen
