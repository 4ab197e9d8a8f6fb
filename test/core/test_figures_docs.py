"""docs/figures.md shows every figure, and the numbers beside the pictures are those of the handover."""

import re
from pathlib import Path

import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.figure_catalogue import FIGURES
from sms_handover.analysis.table import comparison_table
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

DOCS = Path(__file__).resolve().parent.parent.parent / "docs"
TEXT = (DOCS / "figures.md").read_text(encoding="utf-8")
PICTURES = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", TEXT)


def test_every_figure_has_its_section() -> None:
    shown = re.findall(r"^## (\w+): ", TEXT, re.MULTILINE)
    assert sorted(shown) == sorted(kind.name for kind in FIGURES)
    for kind in FIGURES:
        heading = next(line for line in TEXT.splitlines() if line.startswith(f"## {kind.name}: "))
        for number in kind.paper.split(", "):
            assert number in heading


def test_every_picture_is_there_and_shown_and_all_are_small() -> None:
    there = sorted(f"figures/{path.name}" for path in (DOCS / "figures").iterdir())
    assert sorted(PICTURES) == there
    assert sum((DOCS / name).stat().st_size for name in PICTURES) < 1_500_000  # bytes


@pytest.fixture(scope="module")
def runs() -> dict[str, RunData]:
    """The scenario of the paper under both laws; compiled, as four digits are looked at."""
    values = {"common.dynamics": "compiled"}
    found = {law: load_scenario("paper", {**values, "law": law}) for law in ("nmpc", "pid")}
    return {law: simulate(scenario) for law, scenario in found.items()}


def test_the_numbers_are_what_compare_prints(runs: dict[str, RunData]) -> None:
    """Every number with at least three digits and a unit is in the table of the two runs."""
    table = comparison_table(runs)
    printed = set(re.findall(r"[-\d.e]+", table))
    told = re.findall(r"(?<![-\w.])(\d[\d.]*\d)\s(?:mm|degrees|um/s|urad/s|N m)(?!\w)", TEXT)
    assert len(told) >= 13
    assert [number for number in told if number not in printed] == []
    assert compare(runs).claims


def test_the_rounding_is_below_what_is_said(runs: dict[str, RunData]) -> None:
    linear, angular, energy = (
        float(number)
        for number in re.search(r"below (\S+) kg m/s, (\S+) kg m\^2/s, and\s(\S+) of", TEXT).groups()  # type: ignore[union-attr]
    )
    for metrics in compare(runs).runs.values():
        assert metrics.physics.linear_momentum < linear
        assert metrics.physics.angular_momentum < angular
        assert metrics.physics.energy < energy
