"""What the first edition computed and recorded stays: its runs within rounding, each figure of its bags.

Its bits stayed until sums were given a fixed order; the digests are those of the bits since then.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.cli.main import main
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.simulation.simulate import simulate

from ..first_edition import FOLDER, LAWS, digests_of, machine, rows_of, run_of, stored

ROUNDING = 1e-9  # [rad, m, rad/s, m/s, N m] over a whole run, for sums in another order and other machines


@pytest.mark.parametrize("law", LAWS)
def test_the_shipped_handover_keeps_its_bits(law: str) -> None:
    run, then = run_of(law), stored(law)
    if machine() == then.machine:
        assert digests_of(run) == then.digests
    for name, rows in rows_of(run).items():
        np.testing.assert_allclose(rows, then.rows[name], rtol=0.0, atol=ROUNDING, err_msg=name)


@pytest.mark.parametrize("law", LAWS)
def test_a_recorded_run_is_reproduced(law: str, tmp_path: Path) -> None:
    """Within rounding: its sums had no fixed order, so no bit is promised."""
    bag = FOLDER / law
    recorded, again = read_run(bag), simulate(scenario_in(read_info(bag), tmp_path))
    for name in ("joint_position", "joint_velocity", "joint_command", "base_pose", "base_twist"):
        then, now = getattr(recorded, name), getattr(again, name)
        np.testing.assert_allclose(now, then, rtol=0.0, atol=ROUNDING, err_msg=name)


@pytest.mark.parametrize("law", LAWS)
def test_a_recorded_run_is_complete(law: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bag", "check", str(FOLDER / law)]) == 0
    assert "is complete: " in capsys.readouterr().out


def test_figures_of_recorded_runs_are_those_of_then(tmp_path: Path) -> None:
    file = tmp_path / "compared.json"
    assert main(["compare", *(str(FOLDER / law) for law in LAWS), "--json", str(file)]) == 0
    now, then = (json.loads(path.read_text(encoding="utf-8")) for path in (file, FOLDER / "compared.json"))
    completions = [claims[0] for claims in (now["claims"], then["claims"])]
    for completion in completions:  # since then it is judged by clearance too, in two more rows
        del completion["holds"], completion["text"], completion["findings"][4:]
    assert list(different(now, then)) == []


def test_recorded_runs_are_reported(tmp_path: Path) -> None:
    assert main(["report", *(str(FOLDER / law) for law in LAWS), "--output", str(tmp_path / "report")]) == 0
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "arm_b takes end_b" in page


def different(now: Any, then: Any, place: str = "") -> list[str]:
    """Return where JSON values differ from those of then: missing, or not equal up to rounding."""
    if isinstance(now, dict) and isinstance(then, dict):
        missing = [f"{place}/{key}" for key in then.keys() - now.keys()]
        return missing + [
            d for key in now.keys() & then.keys() for d in different(now[key], then[key], f"{place}/{key}")
        ]
    if isinstance(now, list) and isinstance(then, list) and len(now) == len(then):
        pairs = enumerate(zip(now, then, strict=True))
        return [d for index, (a, b) in pairs for d in different(a, b, f"{place}/{index}")]
    if isinstance(now, float) and isinstance(then, float):
        return [] if np.isclose(now, then, rtol=1e-9, atol=1e-15) else [f"{place}: {now} and {then}"]
    return [] if now == then else [f"{place}: {now} and {then}"]
