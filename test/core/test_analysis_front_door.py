"""The way into the analysis that docs/analysis.md shows, run as it stands there."""

import csv
import re
from math import isnan
from pathlib import Path

import numpy as np
import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.metrics import measure
from sms_handover.analysis.records import WALL_TIMES, figures_of, records_of
from sms_handover.bag.run.reader import read_run
from sms_handover.cli.main import main
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.units import MM_PER_M

from .bag_messages import write_run
from .conftest import SCHEDULE

DOCS = Path(__file__).resolve().parent.parent.parent / "docs"
EXAMPLES = re.findall(r"```python\n(.*?)```", (DOCS / "analysis.md").read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recordings where the examples look for them."""
    home = tmp_path_factory.mktemp("home")
    schedule = home / "schedule.yaml"
    schedule.write_text(SCHEDULE, encoding="utf-8")
    for law in ("nmpc", "pid"):
        run = simulate(
            load_scenario("colliding", {"common": {"schedule": str(schedule)}, "controller": {"law": law}})
        )
        (home / "runs" / law).mkdir(parents=True)
        write_run(home / "runs" / law / "bag", run)
    return home


@pytest.fixture(scope="module")
def nmpc(folder: Path) -> RunData:
    return read_run(folder / "runs" / "nmpc" / "bag")


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 3


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs_as_it_stands(example: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    exec(compile(example, "docs/analysis.md", "exec"), {"__name__": "example"})


def test_an_example_prints_what_it_says(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    exec(compile(EXAMPLES[0], "docs/analysis.md", "exec"), {"__name__": "example"})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("('arm_a_joint_1', ") and lines[0].endswith("(1401,) (1401, 14)")
    assert lines[1].startswith("approach arm_a step ")
    assert "position error of arm_a m ('x', 'y', 'z')" in lines[9]
    assert lines[10].startswith("[('completion', False), ('overshoot', ")
    assert [line.split()[:2] for line in lines[11:]] == [
        [run, name] for run in ("nmpc", "pid") for name in ("approach", "carry", "withdraw", "let")
    ]


def test_records_have_every_figure_of_every_phase_and_arm_once(nmpc: RunData) -> None:
    rows = records_of(compare({"one": nmpc, "two": nmpc}))
    keys = [row[:4] for row in rows]
    assert len(set(keys)) == len(keys)
    for run in ("one", "two"):
        for phase in ("approach", "carry", "withdraw", "let go"):
            for arm in ("arm_a", "arm_b"):
                named = {row.figure for row in rows if row[:3] == (run, phase, arm)}
                assert {"overshoot", "settling_time", "steady_state_error", "orientation_overshoot"} < named
                assert {"peak_torque", "rms_torque", "control_effort", "saturated_ticks", "net_work"} < named
            named = {row.figure for row in rows if row[:3] == (run, phase, "")}
            assert {"drift_position_rate", "drift_attitude_change", "energy_residual", "ik_failures"} < named


def test_what_a_run_can_have_is_told_without_one(nmpc: RunData) -> None:
    """But for what takes the robot or a law that plans."""
    rows = {row[1:4] for row in records_of(compare({"one": nmpc}))}
    named = set(figures_of(("approach", "carry", "withdraw", "let go"), nmpc.arms))
    assert rows <= named and {figure[:2] for figure in named - rows} == {("", "")}
    assert {figure for *_, figure in named - rows} == {
        *("solves", "failed_solves", "reused_plans", "late_plans", "binding_share"),
        *("largest_rate_share", "time_above_rate_limit"),
        *("farthest_beyond_position_limit", "time_beyond_position_limit"),
    }
    assert "solve_max" in WALL_TIMES and "held_commands" in WALL_TIMES


def test_records_are_the_metrics(nmpc: RunData) -> None:
    rows = {row[1:4]: row.value for row in records_of(compare({"one": nmpc}))}
    metrics = measure(nmpc)
    carry = metrics.phase("carry")
    assert carry is not None
    assert rows["carry", "arm_b", "overshoot"] == carry.tools["arm_b"].overshoot
    assert (
        rows["carry", "arm_a", "peak_torque"]
        == np.abs(
            nmpc.joint_effort[401:1001, :7]  # the efforts that acted from 0.4 s to 1 s
        ).max()
    )
    assert rows["carry", "", "position_change"] == carry.base.position_change
    assert rows["", "", "ik_solves"] == 71
    assert rows["", "arm_a", "net_work"] + rows["", "arm_b", "net_work"] == pytest.approx(
        nmpc.work[-1], rel=1e-9
    )


def test_compare_writes_the_records_as_csv(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [str(folder / "runs" / law) for law in ("nmpc", "pid")]
    assert main(["compare", *runs, "--csv", str(tmp_path / "figures.csv")]) == 0
    table = capsys.readouterr().out
    with (tmp_path / "figures.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 400
    assert {row["run"] for row in rows} == {"nmpc", "pid"}
    (found,) = [
        float(row["value"])
        for row in rows
        if (row["run"], row["phase"], row["arm"], row["figure"])
        == ("nmpc", "carry", "arm_a", "steady_state_error")
    ]
    assert f" {found * MM_PER_M:.4g} " in table
    nowhere = str(tmp_path / "missing" / "figures.csv")
    assert main(["compare", *runs, "--csv", nowhere]) == 2
    assert "figures.csv cannot be written: No such file or directory" in capsys.readouterr().err
    assert any(isnan(float(row["value"])) for row in rows)  # what never settles, in so short a task
