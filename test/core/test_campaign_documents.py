"""Documents that campaigns write, of made-up figures: ranking, scale, and the section on equality."""

import sys
from argparse import Namespace
from pathlib import Path

import pytest

from benchmarks import campaign_equality, campaign_scale
from docs import evidence
from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.definition.frozen import campaign_path, freeze
from sms_handover.campaign.record.campaign_folder import CampaignFolder, open_campaign
from sms_handover.campaign.record.manifest import Shard

CASES = 6
ERRORS = {"nmpc": 0.001, "mpc": 0.001, "pid": 0.02}  # m


def row(task: Task) -> Row:
    """Return a made-up row: pid misses, mpc finds no plan for its first case and is too fast in the next."""
    if task.law == "mpc" and task.case == 0:
        return Row(task, 1, {}, Status.MISSION_FAILED, "no plan", {}, "00")
    is_good, fast = task.law != "pid", task.law == "mpc" and task.case == 1
    metrics = {
        "grasp_error": ERRORS[task.law] * (1.0 + 0.1 * task.case),
        "clearance": 0.01 * task.case,
        "saturated_ticks": 0.0,
        "time_above_rate_limit": float(fast),
        "time_beyond_position_limit": 0.0,
    }
    status, cause = (Status.SUCCEEDED, "") if is_good else (Status.MISSION_FAILED, "missed")
    return Row(task, 1, {}, status, cause, metrics, "00")


def test_the_ranking_says_what_its_cases_can_tell(tmp_path: Path) -> None:
    """Six pairs have no p below 2^-5; of 6 tests in each of 4 scenarios one has no pair that differs."""
    frozen, _ = freeze(campaign_path("laws"))
    with open_campaign(tmp_path, frozen, CASES, Shard()) as folder:
        campaign = folder.campaign
        tasks = [
            Task(case, scenario, law)
            for case in range(CASES)
            for scenario in campaign.scenarios
            for law in campaign.laws
        ]
        folder.add(*(Done(row(task), Beside(1.0, 1.0, "host")) for task in tasks))
    text = evidence.page(CampaignFolder(tmp_path))
    (mpc,) = (line for line in text.splitlines() if line.startswith("| paper | mpc | 8"))
    assert "| 1 of 5: 20.0 % [3.6, 62.4] |" in mpc, "the case without a plan has no figures"
    assert "| 0 of 6: 0.0 % [0.0, 39.0] |" in text
    assert text.count("Ranked: nmpc above pid by success, mpc above pid by ") == 4, "as many as scenarios"
    assert text.count("Not ranked: nmpc and mpc.") == 4
    assert "6 cases have no p value below 0.031, adjusted for 20 tests none below 0.62. From 10 cases" in text
    assert "base_turn |" not in text.split("## Paired tests")[1], "fewer hypotheses"
    assert "| paper | pid | mission failed | missed | 6 |" in text


def driver(cases: int, running: float) -> campaign_scale.Driver:
    """Return made-up figures of a driver whose memory while it runs is given in MB."""
    return campaign_scale.Driver(cases, 4000.0, running, 130.0, 200.0 + cases / 1e3, 1250.0, 210.0)


SIZES = [driver(cases, 129.0) for cases in campaign_scale.CASES]
PACES = [campaign_scale.Pace(workers, 0.004, None) for workers in (1, 2)]
MANY = campaign_scale.Pace(64, 0.5, 0.4)  # no bound is for so many


@pytest.mark.parametrize(
    ("drivers", "paces", "seconds", "said"),
    [
        (SIZES, [*PACES, MANY], 3.0, []),
        ([*SIZES[:-1], driver(100_000, 143.0)], PACES, 3.0, ["memory", "factor 1.11, at most 1.10"]),
        ([*SIZES[:2], driver(10_000, 143.0)], PACES, 3.0, []),
        (
            SIZES,
            [PACES[0], PACES[1]._replace(overhead=0.021)],
            3.0,
            ["with 2 workers: 21.0 ms, at most 20 ms"],
        ),
        (SIZES, [PACES[0]._replace(overhead=0.16)], 3.0, ["overhead", "efficiency with 1 workers: 0.949"]),
        (SIZES, [PACES[0]._replace(overhead=0.16)], 0.2, []),
    ],
)
def test_a_figure_beyond_its_bound_is_named(
    drivers: list[campaign_scale.Driver], paces: list[campaign_scale.Pace], seconds: float, said: list[str]
) -> None:
    """Bounds are of the full sizes: cases of 3 s with up to two workers, and 1e5 cases of a driver."""
    found = "; ".join(campaign_scale.beyond(drivers, paces, {1: 0.8, 2: 4.9}, seconds))
    assert all(words in found for words in said) and bool(found) == bool(said)
    late = campaign_scale.beyond(SIZES, PACES, {1: 0.8, 2: 5.1}, 3.0)
    assert late == ["Ctrl-C with -j 2: 5.1 s, at most 5 s"]


def test_the_page_of_the_scale_has_figures_and_bounds() -> None:
    text = campaign_scale.page(SIZES, driver(1000, 129.0), [*PACES, MANY], {1: 0.8, 2: 1.6}, 3.0)
    assert "| 2 | 4 | 0.999 | - |" in text and "| 64 | 500 | 0.857 | 400 |" in text
    assert "factor\nof 1.00; the bound is 1.10" in text and "may take 20 ms" in text
    assert "| 2 | 1.6 |" in text and "bound is 5 s" in text
    assert "| 1e7 | 8,333 | 12.5 |" in text, "1e7 rows of 1250 bytes"


def test_the_section_on_equality_takes_the_place_of_the_last_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["", "--cases", "8"])
    tried = [campaign_equality.Tried("a cluster, workers: 2", "16 rows", 3.4)]
    text = campaign_equality.section(Namespace(cases=8, seconds=0.5), tried)
    assert "`python -m benchmarks.campaign_equality --cases 8`: 8 cases of `smooth`" in text
    assert "first 0.5 s, with 5 drawn" in text and "| a cluster, workers: 2 | 16 rows | 3 |" in text
    page = campaign_equality.PAGE.read_text(encoding="utf-8")
    before, after = page.split(campaign_equality.HEAD)[0], page.split(campaign_equality.NEXT)[1]
    written = campaign_equality.with_section(page, text)
    assert written == f"{before}{campaign_equality.HEAD}\n{text}\n{campaign_equality.NEXT}{after}"
    assert campaign_equality.with_section(written, text) == written
