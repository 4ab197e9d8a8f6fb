"""``sms-handover list`` and ``show``: what has a name, and one thing in full."""

import json
from pathlib import Path

import pytest
from my_controller.law import LAW

from sms_handover.analysis import compare, records_of
from sms_handover.analysis.definitions import DEFINITIONS
from sms_handover.analysis.records import UNITS
from sms_handover.cli.main import main

from .bag_messages import made_up_run
from .laws import offer


def listed(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict[str, str]]:
    """Return what ``list`` prints as JSON."""
    assert main(["list", *words, "--json"]) == 0
    found: list[dict[str, str]] = json.loads(capsys.readouterr().out)
    return found


def test_every_figure_of_a_comparison_has_unit_and_definition(capsys: pytest.CaptureFixture[str]) -> None:
    rows = listed(capsys, "metrics")
    units = {row["metric"]: row["unit"] for row in rows}
    rows_of_run = records_of(compare({"one": made_up_run()}))
    found = {row.figure: row.unit for row in rows_of_run if not row.figure.startswith("clearance: ")}
    assert units == units | found
    assert set(units) == set(UNITS) == set(DEFINITIONS)
    assert all(row["definition"] for row in rows)


def test_a_law_of_another_package_is_listed_with_where_it_comes_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    laws = {"task_space_pd": "my_controller.law:LAW", "broken": "my_controller.no_such:LAW"}
    monkeypatch.syspath_prepend(offer(tmp_path / "site", "my_controller", **laws))
    rows = {row["law"]: row for row in listed(capsys, "laws")}
    assert list(rows) == ["nmpc", "pid", "broken", "task_space_pd"]
    assert rows["nmpc"]["package"] == "sms_handover"
    assert rows["task_space_pd"] == {
        "law": "task_space_pd",
        "package": "my_controller",
        "needs": ", ".join(sorted(need.value for need in LAW.needs)),
        "description": LAW.description,
    }
    assert rows["broken"]["description"].startswith("unusable: control law 'broken' of my_controller")
    assert main(["show", "task_space_pd"]) == 0
    assert "stiffness" in capsys.readouterr().out


def test_a_law_is_shown_with_unit_default_and_range(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "nmpc"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["rolling_period", "s", "1.0", "at", "least", "0.001"] in [line[:6] for line in lines]
    assert main(["show", "npmc"]) == 2
    assert "(did you mean 'nmpc'?)" in capsys.readouterr().err
