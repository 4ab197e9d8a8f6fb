"""A run whose phases are done again or given up is analysed, drawn and exported like any other."""

import json
from pathlib import Path

import numpy as np
import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.equality import compare_runs
from sms_handover.analysis.phases import phase_spans
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import comparison_table
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .conftest import SCHEDULE


def run_with(folder: Path, carry: str, withdraw: str) -> RunData:
    text = SCHEDULE.replace("  - name: carry\n", f"  - name: carry\n    on_miss: {carry}\n")
    text = text.replace("  - name: withdraw\n", f"  - name: withdraw\n    on_miss: {withdraw}\n")
    schedule = folder / "schedule.yaml"
    schedule.write_text(text, encoding="utf-8")
    return simulate(
        load_scenario(
            "colliding",
            {
                "common": {"schedule": str(schedule)},
                "controller": {"rolling_period": 0.3},
                "trajectory": {"failure_hold": 0.2},
            },
        )
    )


@pytest.fixture(scope="module")
def again(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    """The first grasp needs two tries; the transfer misses twice and the task is given up."""
    return run_with(tmp_path_factory.mktemp("again"), "{retry: 5}", "{retry: 1}")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    """The same task in which misses change nothing."""
    return run_with(tmp_path_factory.mktemp("plain"), "continue", "continue")


def test_every_span_has_a_name_of_its_own_and_they_leave_no_gap(again: RunData) -> None:
    spans = phase_spans(again)
    assert [(span.name, span.start_ns / 1e9) for span in spans] == [
        ("approach", 0.0),
        ("carry (missed, attempt 1)", 0.4),
        ("approach (attempt 2)", 0.42),
        ("carry", 0.82),
        ("withdraw (missed, attempt 1)", 1.42),
        ("carry (attempt 3)", 1.44),
        ("withdraw (missed, attempt 2)", 2.04),
        ("withdraw (failed)", 2.06),
    ]
    assert [span.end_ns for span in spans[:-1]] == [span.start_ns for span in spans[1:]]
    assert spans[-1].end_ns == again.tick_ns[-1] == 2_260_000_000
    rows = np.concatenate([np.arange(len(again.reference_ns))[span.rows] for span in spans])
    np.testing.assert_array_equal(rows, np.arange(len(again.reference_ns)))


def test_phases_left_alone_keep_their_names(plain: RunData) -> None:
    assert [span.name for span in phase_spans(plain)] == ["approach", "carry", "withdraw", "let go"]


def test_it_compares_with_a_run_that_did_without(again: RunData, plain: RunData) -> None:
    comparison = compare({"again": again, "plain": plain})
    told = json.loads(json.dumps(summary(comparison), allow_nan=False))
    assert [event["kind"] for event in told["runs"]["again"]["run_events"]] == [
        "phase_retried",
        "phase_retried",
        "grasp_failed",
    ]
    table = comparison_table({"again": again, "plain": plain})
    assert "Warnings and errors" in table
    counts = {line.split()[0]: line.split()[-2:] for line in table.splitlines() if "(warning)" in line}
    assert counts["phase_retried"] == ["2", "0"]
    assert counts["grasp_missed"] == ["0", "3"]


def test_a_run_with_decisions_repeats_bit_for_bit(again: RunData, tmp_path: Path) -> None:
    assert compare_runs(again, run_with(tmp_path, "{retry: 5}", "{retry: 1}")) == ()
